"""The page of a run that goes on, in a browser: it keeps up, and its charts and the mechanism move. A parameter
is changed; a request out of range is refused in words until a good one comes. The run is stopped, and its report takes the place
of the page at the same address. The page asks nothing but the rig.

Usage: live.py MASSETER FOLDER [CHROMIUM]
"""

import json
import subprocess
import sys
import time
from pathlib import Path

from playwright.sync_api import expect, sync_playwright

MASSETER, FOLDER = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
BROWSER = sys.argv[3] if len(sys.argv) > 3 else None
LENIENT = Path(__file__).parents[1] / "lenient.toml"
SCENARIO = """name = "watched"
duration_s = 60.0
[[require]]
name = "incisal"
signal = "incisal.error"
during = "running"
max = "5 mm"
"""
# Ten updates a second, less what a loaded machine takes.
LEAST_HZ = 5.0
STOPPED = 130
PHONE = {"width": 390, "height": 844}


def start():
    scenario = FOLDER / "watched.toml"
    scenario.write_text(SCENARIO + LENIENT.read_text())
    rig = subprocess.Popen(
        [MASSETER, "run", scenario, "--clock", "rt", "--live=127.0.0.1:0", "--quiet", "--out", FOLDER / "watched"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )
    return rig, next(line.split()[-1] for line in rig.stderr if line.startswith("live in a browser"))


def browser(chromium):
    return chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])


rig, url = start()
with sync_playwright() as playwright:
    page = browser(playwright.chromium).new_page(viewport={"width": 1280, "height": 900})
    said, asked = [], []
    page.on("console", lambda message: said.append(message.text))
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.on("websocket", lambda socket: asked.append(socket.url))
    page.goto(url)
    page.wait_for_selector("html[data-live=yes]", state="attached")
    state = page.locator("#now strong")
    expect(state).to_have_text("running", timeout=20_000)

    # It keeps up, and what it shows grows.
    shown = "[Masseter.live.number, Masseter.time.range[1], document.querySelector('#now .panel p').textContent]"
    page.wait_for_selector("#section-mechanism canvas")
    before, began = page.evaluate(shown), time.monotonic()
    page.wait_for_timeout(4000)
    after, seconds = page.evaluate(shown), time.monotonic() - began
    rate_hz = (after[0] - before[0]) / seconds
    assert rate_hz > LEAST_HZ, rate_hz
    assert after[1] - before[1] > 0.7 * seconds and after[2] != before[2], (before, after)
    curve = page.locator("#section-motion .chart svg[tabindex] path.curve").first
    curve.scroll_into_view_if_needed()
    drawn = curve.get_attribute("d")
    expect(curve).not_to_have_attribute("d", drawn, timeout=10_000)
    assert "incisal" in page.locator("#requirements").inner_text()

    # A parameter is changed; a value out of its range is refused in words.
    gain = page.get_by_label("integral_gain_per_s")
    gain.fill("7")
    gain.press("Tab")
    listed = [MASSETER, "param", "get", "integral_gain_per_s"]
    for _ in range(20):
        page.wait_for_timeout(500)
        if (value := subprocess.run(listed, capture_output=True, text=True).stdout.strip()) == "7":
            break
    assert value == "7", value
    gain.fill("-3")
    gain.press("Tab")
    note = page.locator("#now .note")
    expect(note).to_contain_text("integral_gain_per_s")
    gain.fill("6")
    gain.press("Tab")
    expect(note).to_have_text("", timeout=5_000)

    # A second window of a phone has the whole run so far, and fits.
    phone = browser(playwright.chromium).new_page(viewport=PHONE)
    phone.goto(url)
    phone.wait_for_selector("html[data-live=yes]", state="attached")
    assert phone.evaluate("Masseter.points ? document.documentElement.scrollWidth : 0") <= PHONE["width"]
    first_s = phone.evaluate("JSON.parse(document.getElementById('data').textContent).time.motion_s")
    assert first_s is not None

    stop = page.locator("#now .stop")
    asking = stop.evaluate("button => getComputedStyle(button).color")
    stop.click()
    assert stop.is_disabled() and stop.evaluate("button => getComputedStyle(button).color") != asking
    # Both windows get the report, with the verdict.
    for shown in (page, phone):
        expect(shown.locator("#verdict")).to_contain_text("INTERRUPTED", timeout=30_000)
        assert "stopped by the user" in shown.locator("#verdict").inner_text() and shown.url == url
    own = url.replace("http", "ws")
    assert all(each in (url,) or each.startswith(own) for each in asked), asked
    assert not said, said

assert rig.wait() == STOPPED, rig.stdout.read()
events = [json.loads(line) for line in (FOLDER / "watched" / "events.jsonl").read_text().splitlines()]
assert any("parameter_set" in json.dumps(event) for event in events)
print(f"live page: {rate_hz:.1f} updates a second")
