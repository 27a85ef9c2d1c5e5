"""The book of the documents in a browser: its search finds a fact, each third page loads without an error and fits a phone, all of
them with EVERY_CASE=1, and axe finds nothing serious in the light and the dark theme.

Usage: book.py FOLDER [CHROMIUM]
"""

import os
import sys
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

BOOK = Path(sys.argv[1]).resolve()
BROWSER = sys.argv[2] if len(sys.argv) > 2 else None
PHONE = {"width": 390, "height": 844}
# Pages of each kind: prose, wide tables, commands, pictures.
JUDGED = ["docs/verdicts.html", "docs/tutorials/robot.html", "docs/kinematics.html"]
# What a reader types, and the page that has the answer.
SOUGHT = {"exit code 5": "verdicts", "doctor remedy": "troubleshooting", "quick stop": "robot", "lead_cycles": "scenario"}


def search(page: Page) -> None:
    """The page with the answer is among the first five results."""
    page.goto((BOOK / "index.html").as_uri())
    for words, document in SOUGHT.items():
        page.keyboard.press("/")
        page.locator("#mdbook-searchbar").press_sequentially(words)
        page.wait_for_function(f"document.querySelector('#mdbook-searchresults-header').textContent.includes('{words}')")
        found = page.eval_on_selector_all("#mdbook-searchresults li a", "links => links.map(link => link.href)")
        assert any(f"/{document}.html" in link for link in found[:5]), (words, found[:5])
        page.keyboard.press("Escape")


def judge(page: Page, scheme: str, names: list[str]) -> None:
    page.emulate_media(color_scheme=scheme)
    for name in names:
        page.goto((BOOK / name).as_uri())
        # The button of the contents is mdbook's own: a label with the state of its check box.
        violations = Axe().run(page, context={"exclude": [["#mdbook-sidebar-toggle"]]}).response["violations"]
        serious = [(found["id"], found["nodes"][0]["html"]) for found in violations if found["impact"] in ("serious", "critical")]
        assert not serious, (scheme, name, serious)


def fit(page: Page) -> int:
    """On a phone a wide table scrolls by itself, and the page does not."""
    page.set_viewport_size(PHONE)
    pages = sorted(path for path in BOOK.rglob("*.html") if path.name not in ("404.html", "toc.html"))
    pages = pages[:: 1 if "EVERY_CASE" in os.environ else 3]
    for path in pages:
        page.goto(path.as_uri(), wait_until="domcontentloaded")
        width = page.evaluate("document.documentElement.scrollWidth")
        assert width <= PHONE["width"], (path, width)
    return len(pages)


with sync_playwright() as playwright, playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"]) as browser:
    page = browser.new_page()
    errors: list[str] = []
    page.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))
    search(page)
    count = fit(page)
    assert not errors, errors
    # axe reads the style sheets itself, which the browser refuses for files and reports as errors.
    judge(browser.new_page(), "light", JUDGED)
    judge(browser.new_page(), "dark", JUDGED[:1])
    print(f"book: {count} pages fit a phone without an error; search and axe passed")
