"""The page of the paper's claims in a browser: no error, every link leads somewhere, it fits a phone, prints, and axe finds nothing serious in either theme.

Usage: study.py STUDY [CHROMIUM]
"""

import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import sync_playwright

PAGE = (Path(sys.argv[1]) / "study.html").resolve()
BROWSER = sys.argv[2] if len(sys.argv) > 2 else None
PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True}
# The brightness of the page's ground in either theme, then the ways to open the page.
LIGHT, DARK = range(200, 256), range(60)
VIEWS = [({}, LIGHT), ({"color_scheme": "dark"}, DARK), (PHONE, LIGHT)]

with sync_playwright() as playwright, playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"]) as browser:
    for settings, brightness in VIEWS:
        page = browser.new_context(**settings).new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(PAGE.as_uri())
        page.wait_for_selector("html[data-ready=yes]", state="attached")
        claims, figures = page.locator("#claims tbody tr").count(), page.locator(".block-figure").count()
        assert claims == 18 and figures == 17, (claims, figures)
        lost = page.eval_on_selector_all("a[href^='#']", "all => all.map(one => one.hash.slice(1)).filter(id => !document.getElementById(id))")
        assert not lost, lost
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= page.viewport_size["width"], width
        ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert all(int(part) in brightness for part in ground[4:-1].split(",")), ground
        serious = [(found["id"], found["nodes"][0]["html"]) for found in Axe().run(page).response["violations"]
                   if found["impact"] in ("serious", "critical")]
        assert not serious, (settings, serious)
        assert not said, said
    pdf = page.pdf(prefer_css_page_size=True)
    assert pdf.startswith(b"%PDF") and pdf.count(b"/Type /Page\n") > 1
    print(f"study: {claims} claims and {figures} figures in light, dark, on a phone and on paper; axe passed")
