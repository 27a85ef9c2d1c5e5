"""The pages of runs, campaigns, suites and studies in a browser, used as a hand does: it loads fast, fetches nothing, draws every chart, follows pointer, wheel,
fingers and keys, fits a phone, prints, has a dark face, and axe finds nothing serious. However a run ends, its cause is on the
first screen, nothing is cut, and the page of a stop opens around the stop.

Usage: page.py MASSETER FOLDER [CHROMIUM]
"""

import csv
import io
import os
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as xml
from pathlib import Path

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Page, sync_playwright

MASSETER, FOLDER = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
BROWSER = sys.argv[3] if len(sys.argv) > 3 else None
LARGEST_MB = 3.0
# A page loads in this many times the time of REFERENCE in the same browser: a limit in seconds judges the machine.
LONGEST = 3.0
REFERENCE = """() => {
    const began = performance.now();
    let sum = 0;
    for (let at = 0; at < 5e7; at += 1) sum += Math.sin(at);
    return sum < 2 ? (performance.now() - began) / 1000 : NaN;
}"""
PHONE = {"width": 390, "height": 844}
DESK = {"width": 1280, "height": 900}


def run(name: str, *arguments: str, code: int = 0, clock: str = "virtual") -> Path:
    """The page of a run in simulated time."""
    command = [MASSETER, "run", *arguments, "--clock", clock, "--out", FOLDER / name]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == code, ended.stdout + ended.stderr
    return FOLDER / name / "report.html"


def spoiled(name: str) -> Path:
    """The page of a run that is INVALID: it allows no lost cycle, and its controller is stopped again and again, as a machine does that
    is too busy."""
    command = [MASSETER, "run", "--clock", "rt", "--duration", "3", "--set", "checks.timing='strict'", "--out", FOLDER / name]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as rig:
        for _ in range(40):
            time.sleep(0.1)
            for child in Path(f"/proc/{rig.pid}/task/{rig.pid}/children").read_text().split():
                if b"controller" in Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0"):
                    os.kill(int(child), signal.SIGSTOP)
                    time.sleep(0.005)
                    os.kill(int(child), signal.SIGCONT)
        said = rig.communicate()[0]
    assert rig.returncode == 3, said
    return FOLDER / name / "report.html"


class Sheet:
    """A page that is open in a browser of its own settings; everything that it says or asks for is kept."""

    def __init__(self, browser, path: Path, view: str = "", **settings):
        context = browser.new_context(**{"viewport": DESK, **settings}, accept_downloads=True)
        self.page: Page = context.new_page()
        self.said, self.asked = [], []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        began = time.monotonic()
        self.page.goto(path.as_uri() + view, wait_until="load")
        self.page.wait_for_selector("html[data-ready=yes]", state="attached")
        self.loaded_s = time.monotonic() - began

    def get(self, script: str):
        return self.page.evaluate(script)

    def chart(self, name: str):
        """The drawing of a chart, in view."""
        drawing = self.page.locator(f"#{name} svg[tabindex]")
        drawing.evaluate("element => element.scrollIntoView({block: 'center'})")
        return drawing

    def frame(self):
        """Waits until what is due has been drawn."""
        self.get("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))")

    def close(self):
        assert self.said == [], self.said
        others = [url for url in self.asked if not url.startswith(("file:", "blob:"))]
        assert others == [] and len([url for url in self.asked if url.startswith("file:")]) == 1, self.asked
        self.page.context.close()


def loads_fast(browser, path: Path) -> float:
    """The shortest time to load the page, in times of REFERENCE; both are measured in turn."""
    loaded_s, reference_s = [], []
    for _ in range(3):
        sheet = Sheet(browser, path)
        loaded_s.append(sheet.loaded_s)
        reference_s.append(sheet.get(REFERENCE))
        sheet.close()
    print(f"{path.parent.name}: {min(loaded_s):.2f} s; the reference {min(reference_s):.2f} s")
    ratio = min(loaded_s) / min(reference_s)
    assert ratio < LONGEST, f"{path} loads in {ratio:.2f} times the reference"
    return ratio


def draws_every_chart(sheet: Sheet):
    """A curve has a height in pixels, and its colour is really in the picture."""
    sheet.get("() => document.querySelectorAll('details.block').forEach(details => { details.open = true; })")
    sheet.frame()
    names = sheet.get("() => [...document.querySelectorAll('.block-chart')].map(block => block.id)")
    assert len(names) > 12, names
    empty = [name for name in names if not sheet.page.locator(f"#{name} svg[tabindex] path.curve[d^=M]").count()]
    assert empty == [], empty
    for name in names:
        drawing = sheet.chart(name)
        sheet.frame()
        shades = sheet.get(f"""async () => {{
            const text = Masseter.svgText(Masseter.handles.get('{name}').chart);
            const image = new Image();
            image.src = 'data:image/svg+xml,' + encodeURIComponent(text);
            await image.decode();
            const canvas = Object.assign(document.createElement('canvas'), {{width: image.width, height: image.height}});
            const pen = canvas.getContext('2d');
            pen.drawImage(image, 0, 0);
            const {{data}} = pen.getImageData(0, 0, canvas.width, canvas.height);
            let coloured = 0;
            for (let at = 0; at < data.length; at += 4) {{
                if (Math.max(data[at], data[at + 1], data[at + 2]) - Math.min(data[at], data[at + 1], data[at + 2]) > 60) coloured += 1;
            }}
            return coloured;
        }}""")
        assert shades > 300, f"{name}: {shades} coloured pixels"
        assert drawing.bounding_box()["height"] > 100, name


def keeps_extremes(sheet: Sheet):
    """The highest point of a noisy curve is drawn where it is, although there are fewer pixels than points."""
    found = sheet.get("""() => {
        const {series, plot} = Masseter.handles.get('force-slides').chart;
        const raw = series.find(({style}) => style === 'raw');
        const paths = [...document.querySelectorAll('#force-slides svg[tabindex] path.curve.raw')];
        const drawn = Math.min(...paths[0].getAttribute('d').match(/ [-\\d.]+/g).map(Number));
        return {points: raw.xs.length, pixels: plot.right - plot.left, drawn, expected: plot.y.position(Math.max(...raw.ys))};
    }""")
    assert found["points"] > 4 * found["pixels"], found
    assert abs(found["drawn"] - found["expected"]) < 0.06, found


def follows_the_pointer(sheet: Sheet):
    """The value beside the name is that of the curve, and other charts show the same moment."""
    drawing = sheet.chart("legs")
    box = drawing.bounding_box()
    sheet.page.mouse.move(box["x"] + 0.6 * box["width"], box["y"] + 80)
    sheet.frame()
    found = sheet.get("""() => {
        const {series} = Masseter.handles.get('legs').chart;
        const shown = document.querySelector('#legs .legend .value').textContent;
        return {shown, value: Masseter.valueAt(series[0], Masseter.time.cursor), at: Masseter.time.text(Masseter.time.cursor),
            box: document.querySelector('#legs .box')?.textContent, bar: document.querySelector('#time-bar output').textContent,
            dots: document.querySelectorAll('#legs .cursor circle').length, linked: document.querySelectorAll('#slides .cursor line').length};
    }""")
    assert found["shown"].endswith(" mm"), found
    assert abs(float(found["shown"].removesuffix(" mm")) - found["value"]) < 0.01, found
    assert found["box"].startswith(found["at"]) and found["bar"] == found["at"], found
    assert found["dots"] == 3 and found["linked"] == 1, found


def zooms(sheet: Sheet):
    page, window = sheet.page, "() => Masseter.time.window"
    whole = sheet.get(window)
    ticks = "() => [...document.querySelectorAll('#motion-z .tick')].map(tick => tick.textContent).join()"
    before = sheet.get(ticks)
    box = sheet.chart("legs").bounding_box()
    x, y = box["x"], box["y"] + 80
    page.mouse.move(x + 0.4 * box["width"], y)
    page.mouse.down()
    page.mouse.move(x + 0.6 * box["width"], y, steps=4)
    page.mouse.up()
    sheet.frame()
    dragged = sheet.get(window)
    length = (whole[1] - whole[0]) * 0.2
    assert 0.9 * length < dragged[1] - dragged[0] < 1.4 * length, (whole, dragged)
    # The other charts follow once they are seen.
    sheet.chart("motion-z")
    page.wait_for_function(f"before => ({ticks})() !== before", arg=before, timeout=5000)
    box = sheet.chart("legs").bounding_box()
    page.mouse.move(x + 0.5 * box["width"], box["y"] + 80)
    page.keyboard.down("Control")
    page.mouse.wheel(0, -200)
    page.keyboard.up("Control")
    sheet.frame()
    wheeled = sheet.get(window)
    assert wheeled[1] - wheeled[0] < 0.8 * (dragged[1] - dragged[0]), (dragged, wheeled)
    page.mouse.dblclick(x + 0.5 * box["width"], box["y"] + 80)
    assert sheet.get(window) == whole, ("a double click shows everything", sheet.get(window))
    sheet.chart("legs").focus()
    at = sheet.get("() => Masseter.time.cursor")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("+")
    moved, zoomed = sheet.get("() => Masseter.time.cursor"), sheet.get(window)
    assert moved > at and zoomed[1] - zoomed[0] < 0.6 * (whole[1] - whole[0]), (at, moved, zoomed)
    assert " mm" in page.locator(".spoken").text_content(), "a screen reader hears the values"
    page.keyboard.press("Escape")
    assert sheet.get(window) == whole


def toggles_curves_and_time(sheet: Sheet):
    page = sheet.page
    button = page.locator("#legs .legend button").first
    button.click()
    sheet.frame()
    assert page.locator("#legs path.curve[d^=M]").count() == 2 + 3, "three keys and two curves"
    button.click()
    page.select_option("#time-bar select", "cycle")
    sheet.frame()
    assert "cycle" in page.locator("#legs svg[tabindex]").text_content()
    worst = page.locator("#worst tbody tr").first
    cycle, at_s = worst.locator("th").text_content(), worst.locator("td").first.text_content().replace("\u2212", "-")
    shown = sheet.get(f"() => Masseter.time.shown(Masseter.time.time.motion_s + {at_s})")
    assert abs(shown - float(cycle)) <= 1, (cycle, shown)
    page.select_option("#time-bar select", "motion")


def tells_wall_time(sheet: Sheet):
    sheet.page.select_option("#time-bar select", "wall")
    sheet.get("() => Masseter.time.seek(1.5)")
    assert sheet.page.locator("#time-bar output").text_content() == "11:46:41.750 UTC"
    sheet.chart("legs")
    sheet.frame()
    ticks = sheet.page.locator("#legs svg[tabindex] .tick").all_text_contents()
    assert "11:46:45" in ticks and "time, UTC" in ticks, ticks
    sheet.get("() => Masseter.time.zoom(1, 1.02)")
    sheet.frame()
    assert "11:46:41.260" in sheet.page.locator("#legs svg[tabindex] .tick").all_text_contents()


def saves(sheet: Sheet):
    def saved(name: str) -> str:
        sheet.chart("force-legs")
        sheet.page.click("#force-legs .menu summary")
        with sheet.page.expect_download() as download:
            sheet.page.click(f"#force-legs .menu button:has-text('{name}')")
        return Path(download.value.path()).read_text()

    rows = list(csv.reader(io.StringIO(saved("CSV"))))
    assert rows[0][0] == "motion time, s" and "l1 (N)" in rows[0] and len(rows) > 1000, rows[0]
    times = [float(row[0]) for row in rows[1:]]
    assert times == sorted(times) and times[0] < 0 < times[-1], (times[0], times[-1])
    drawing = xml.fromstring(saved("SVG"))
    paths = [part for part in drawing.iter("{http://www.w3.org/2000/svg}path") if part.get("d", "").startswith("M")]
    assert len(paths) >= 12 and all(part.get("stroke", "").startswith("rgb") for part in paths), len(paths)


def plays(sheet: Sheet):
    sheet.get("() => Masseter.time.seek(1)")
    sheet.page.click("#time-bar .play")
    sheet.page.wait_for_function("() => Masseter.time.cursor > 1.3", timeout=10_000)
    sheet.page.click("#time-bar .play")
    assert not sheet.get("() => Masseter.time.isPlaying")


def marks_the_stop(sheet: Sheet):
    marks = sheet.page.locator("#motion-z .moment line")
    assert marks.count() == 4, marks.count()
    text = sheet.page.locator("#motion-z svg[tabindex]").text_content()
    assert "fault 1" in text and "safe stop" in text, text
    assert "reaction" in text and "standstill" in text, text
    folded = sheet.page.locator("#events details")
    assert folded.get_attribute("open") is None and folded.locator("li").count() > 20


def is_told_first(sheet: Sheet, words: str, next_step: str):
    """Cause and next step are on the first screen, what failed is in the first row, and no table is cut."""
    told = [(sheet.page.locator("#verdict .panel").first, words)]
    if next_step:
        told.append((sheet.page.locator("#verdict .next"), next_step))
    else:
        assert sheet.page.locator("#verdict .next").count() == 0
    for place, part in told:
        box = place.bounding_box()
        assert part in place.inner_text() and box["y"] + box["height"] < 600, (part, place.inner_text(), box)
    marks = sheet.page.locator("#checks .mark").all_text_contents()
    bad = [mark in ("FAIL", "lost", "UNTESTED") for mark in marks]
    assert bad == sorted(bad, reverse=True), marks
    for media in ("print", "screen"):
        sheet.page.emulate_media(media=media)
        cut = sheet.get("""() => [...document.querySelectorAll('#checks .table, #moments .table')]
            .filter(table => table.scrollWidth > table.clientWidth + 1).length""")
        assert cut == 0, (media, cut)


def opens_around_the_stop(sheet: Sheet):
    """The window is that around the stop; buttons, keys and a drag with Shift move it, and a click on a time shows what was there."""
    page = sheet.page
    window = lambda: [round(at, 3) for at in sheet.get("() => Masseter.time.window")]
    stop_s, (begin, end) = sheet.get("() => Masseter.moments.find(({kind}) => kind === 'detection').at_s"), window()
    assert abs(begin - stop_s + 0.05) < 2e-3 and abs(end - stop_s - 0.5) < 2e-3, (begin, stop_s, end)
    for axis in ("reported", "true"):
        assert axis in page.locator("#stop-axis .legend").inner_text()
    assert page.locator("#moments tbody tr").count() == 4
    page.click("#time-bar .whole")
    assert window() == [0, round(sheet.get("() => Masseter.time.range[1]"), 3)]
    page.click("#time-bar .moment")
    assert window() == [begin, end]
    box = sheet.chart("legs").bounding_box()
    y = box["y"] + 80
    page.keyboard.down("Shift")
    page.mouse.move(box["x"] + 0.4 * box["width"], y)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.6 * box["width"], y, steps=4)
    page.mouse.up()
    page.keyboard.up("Shift")
    panned = window()
    assert panned[0] < begin - 0.1 and abs(panned[1] - panned[0] - end + begin) < 2e-3, (panned, begin, end)
    sheet.chart("legs").focus()
    page.keyboard.press(".")
    assert window()[0] > panned[0] + 0.1, (window(), panned)
    page.locator("#moments button").first.click()
    assert abs(window()[0] - sheet.get("() => Masseter.moments[0].at_s") + 0.05) < 2e-3


def names_its_view(browser, path: Path):
    """The address opens the same window."""
    sheet = Sheet(browser, path)
    sheet.get("() => Masseter.time.zoom(2, 2.5)")
    sheet.page.wait_for_function("() => location.hash.startsWith('#t=')")
    view = sheet.get("() => location.hash")
    sheet.close()
    sheet = Sheet(browser, path, view)
    assert [round(at, 3) for at in sheet.get("() => Masseter.time.window")] == [2, 2.5], view
    sheet.close()


def shows_what_was_judged(sheet: Sheet):
    """A requirement on an rms shows the shaded window, the rms and the limit; a failed one comes first."""
    text = sheet.page.locator("#section-requirements .block-chart").first.inner_text()
    assert text.startswith("close"), text
    drawing = sheet.chart("requirement-1")
    sheet.frame()
    words = drawing.text_content()
    assert drawing.locator(".shade").count() == 1 and "rms 0.006" in words and "limit 0.002 mm" in words, words


def draws_bands(sheet: Sheet):
    """A motion that is too fast for the pixels is a band; zoomed in, it is a curve."""
    sheet.chart("motion-y")
    sheet.frame()
    assert sheet.page.locator("#motion-y path.banded").count() == 3
    sheet.get("() => Masseter.time.zoom(10, 12)")
    sheet.frame()
    sheet.page.wait_for_function("() => !document.querySelector('#motion-y path.banded')")


def goes_on(sheet: Sheet):
    """What a run that goes on adds."""
    found = sheet.get("""() => {
        const end = Masseter.time.range[1];
        Masseter.time.extend(end + 1);
        Masseter.append('bite-of-a-test', 'none', [0, 1]);
        Masseter.append('legs', 'l1', [end + 0.5, 250, end + 1, 260]);
        Masseter.append('legs', 'new', [end + 0.5, 250, end + 1, 260]);
        const {series} = Masseter.handles.get('legs').chart;
        return {end: Masseter.time.window[1] - end, names: series.map(({name}) => name), last: series[0].ys[series[0].ys.length - 1]};
    }""")
    assert found == {"end": 1, "names": ["l1", "l2", "l3", "new"], "last": 260}, found
    sheet.get("""() => Masseter.update('verdict', {word: 'RUNNING', reason: 'see `masseter`', tone: 'plain', timing: 'held',
        timing_reason: '', timing_tone: 'good', figures: []})""")
    assert sheet.page.locator("#verdict code").text_content() == "masseter"


def pinches(sheet: Sheet):
    """Two fingers move apart."""
    box = sheet.chart("legs").bounding_box()
    session = sheet.page.context.new_cdp_session(sheet.page)
    middle, y = box["x"] + 0.55 * box["width"], box["y"] + 80

    def touch(kind: str, apart: float):
        points = [] if kind == "touchEnd" else [{"x": middle + side * apart, "y": y, "id": side + 1} for side in (-1, 1)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    whole = sheet.get("() => Masseter.time.window")
    touch("touchStart", 30)
    for apart in (40, 60, 80, 90):
        touch("touchMove", apart)
    touch("touchEnd", 0)
    window = sheet.get("() => Masseter.time.window")
    assert window[1] - window[0] < 0.5 * (whole[1] - whole[0]), (whole, window)


def shows_the_jaw_in_space(sheet: Sheet):
    """Every view draws another picture; the cursor moves the jaw, and an exaggerated error moves it away from the desired one."""
    canvas = sheet.page.locator(".scene canvas")
    canvas.scroll_into_view_if_needed()

    def picture() -> str:
        sheet.frame()
        return canvas.evaluate("canvas => canvas.toDataURL()")

    sheet.get("() => Masseter.time.seek(Masseter.page.time.motion_s + 2.6)")
    seen = [picture()]
    for key in ("2", "3", "4", "ArrowLeft", "+"):
        canvas.press(key)
        seen.append(picture())
    canvas.press("1")
    assert picture() == seen[0], "the first view has changed"
    sheet.page.click(".scene [data-value=whole]")
    seen.append(picture())
    sheet.page.click(".scene [data-value=jaw]")
    sheet.page.select_option(".scene select", "1000")
    seen.append(picture())
    sheet.page.select_option(".scene select", "1")
    sheet.get("() => Masseter.time.seek(Masseter.page.time.motion_s + 2.9)")
    seen.append(picture())
    assert len(set(seen)) == len(seen), [seen.index(one) for one in seen]


def bites(sheet: Sheet):
    """While teeth or food press on the jaw, the force is drawn and said."""
    sheet.get("""() => {
        const {forces} = Masseter.page.sections.flatMap(({blocks}) => blocks).find(({kind}) => kind === 'scene').data;
        Masseter.time.seek(forces[Math.floor(forces.length / 2)][0]);
    }""")
    sheet.frame()
    said = sheet.page.locator(".scene .state").inner_text()
    assert float(said.split("teeth ")[1].split(" N")[0]) > 1, said


def shows_the_paths_of_the_jaw(sheet: Sheet):
    """Planes have one scale along both axes; a click on a path moves the cursor; the values are saved as they are drawn."""
    planes = sheet.page.locator("#jaw .plane")
    assert planes.count() >= 8, planes.count()
    scales = sheet.get("""() => [...document.querySelectorAll('#jaw .plane')].slice(0, 6).map(plane => {
        const ticks = [...plane.querySelectorAll('svg[role=img] .tick')].filter(tick => /^[−\\d.]+$/.test(tick.textContent));
        const value = tick => Number(tick.textContent.replace('−', '-'));
        const along = (name, anchor) => {
            const [first, second] = ticks.filter(tick => tick.getAttribute('text-anchor') === anchor);
            return (second.getAttribute(name) - first.getAttribute(name)) / (value(second) - value(first));
        };
        return along('x', 'middle') / along('y', 'end');
    })""")
    assert all(abs(scale + 1) < 0.01 for scale in scales), scales
    sheet.get("() => Masseter.time.seek(null)")
    planes.first.scroll_into_view_if_needed()
    x, y = sheet.get("""() => {
        const drawing = document.querySelector('#jaw .plane svg[role=img]'), curve = drawing.querySelectorAll('path.curve')[1];
        const at = curve.getPointAtLength(curve.getTotalLength() * 0.03), box = drawing.getBoundingClientRect();
        const scale = box.width / drawing.viewBox.baseVal.width;
        return [box.left + at.x * scale, box.top + at.y * scale];
    }""")
    sheet.page.mouse.click(x, y)
    assert sheet.get("() => Masseter.time.cursor") is not None
    for kind, begin in (("SVG", b"<svg"), ("PNG", b"\x89PNG"), ("CSV", b'"curve"')):
        planes.first.locator("summary").click()
        with sheet.page.expect_download() as saved:
            planes.first.get_by_text(f"Save as {kind}").click()
        assert Path(saved.value.path()).read_bytes().startswith(begin), kind


def counts_the_cycles(sheet: Sheet):
    """Ten seconds of the default motion have thirteen cycles of 18 mm; the rig's ramps take two of them."""
    rows = dict(sheet.page.locator("#jaw tbody tr").evaluate_all("rows => rows.map(row => [row.cells[0].textContent, row.cells.length < 9 ? '' : row.cells[1].textContent])"))
    assert abs(float(rows["duration, beginning to beginning"]) - 0.7) < 0.002 and abs(float(rows["opening"]) - 18) < 0.1, rows
    sheet.page.locator("#jaw details:has(pre.choice) summary").first.click()
    for cycle in (3, 5):
        sheet.page.get_by_label(f"leave out cycle {cycle}", exact=True).check()
    chosen = sheet.page.locator("#jaw pre.choice").text_content()
    assert chosen == "[study]\nleave_out = [3, 5]", chosen


def fits_the_screen(sheet: Sheet):
    """Also after another medium, once the charts have been drawn for the screen again."""
    sheet.page.wait_for_function("width => document.documentElement.scrollWidth <= width", arg=sheet.page.viewport_size["width"], timeout=10_000)


def is_accessible(sheet: Sheet):
    found = Axe().run(sheet.page).response["violations"]
    serious = [(rule["id"], [node["target"] for node in rule["nodes"]][:3]) for rule in found if rule["impact"] in ("serious", "critical")]
    assert serious == [], serious


def prints(sheet: Sheet):
    pdf = sheet.page.pdf(prefer_css_page_size=True)
    assert pdf.startswith(b"%PDF") and 1 <= pdf.count(b"/Type /Page\n") <= 20, pdf.count(b"/Type /Page\n")
    sheet.page.emulate_media(media="print")
    hidden = sheet.page.locator("#time-bar, .menu").evaluate_all("all => all.every(one => getComputedStyle(one).display === 'none')")
    assert hidden, "controls are printed"
    background = sheet.get("() => getComputedStyle(document.body).backgroundColor")
    assert background == "rgb(255, 255, 255)", background


def is_dark(sheet: Sheet):
    background, text = (sheet.get(f"() => getComputedStyle(document.body).{name}") for name in ("backgroundColor", "color"))
    shade = [sum(int(part) for part in colour[4:-1].split(",")) for colour in (background, text)]
    assert shade[0] < 100 < 500 < shade[1], (background, text)


def campaign() -> Path:
    """The page of a campaign some of whose cases fail."""
    file = Path("examples/campaign/friction.toml")
    short = file.read_text().replace("runs = 200", "runs = 24")
    planned = FOLDER / "friction.toml"
    planned.write_text(short.replace("chewing.toml", str(file.resolve().parent / "chewing.toml")))
    command = [MASSETER, "campaign", planned, "--out", FOLDER / "campaign", "--record", "1"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    return FOLDER / "campaign" / "campaign.html"


def suite() -> Path:
    """The page of a suite of which one scenario fails."""
    folder = FOLDER / "suite"
    folder.mkdir()
    require = "[[require]]\nname = 'near'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '{}'\n"
    for name, limit in (("good", "1 mm"), ("bad", "2 um")):
        (folder / f"{name}.toml").write_text(f"name = '{name}'\nduration_s = 2.0\n{require.format(limit)}")
    command = [MASSETER, "test", folder, "--html", FOLDER / "suite.html", "--out", FOLDER / "kept"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 1, ended.stdout + ended.stderr
    return FOLDER / "suite.html"


def study() -> Path:
    """The page that compares two sessions of a person."""
    for session, opening in (("before", 18), ("after", 15)):
        settings = [f"study.session={session}", "study.patient=P1", f"motion.vertical_mm={opening}"]
        run(session, "--duration", "4", *(part for setting in settings for part in ("--set", setting)))
    command = [MASSETER, "compare", FOLDER / "before", FOLDER / "after", "--out", FOLDER / "study"]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return FOLDER / "study" / "compare.html"


def follows_links(sheet: Sheet):
    """Each link of a table leads to a file."""
    links = sheet.get("[...document.querySelectorAll('td a, th a')].map(({ href }) => href)")
    assert links and all(Path(link.removeprefix("file://")).exists() for link in links), links


def hovered(sheet: Sheet, name: str, series: int, place: int) -> list[str]:
    """What a chart says of a point under the pointer."""
    drawing = sheet.chart(name)
    x, y = sheet.get(f"(() => {{ const {{ plot, series }} = Masseter.handles.get('{name}').chart, one = series[{series}];"
                     f" return [plot.x.position(one.xs[{place}]), plot.y.position(one.ys[{place}])]; }})()")
    drawing.hover(position={"x": x, "y": y})
    return drawing.locator(".box text").all_text_contents()


def counts_margins(sheet: Sheet):
    """The bars of the histogram together are all margins; the pointer says how many have which."""
    name = sheet.get("[...document.querySelectorAll('#section-result .block-chart')].map(({ id }) => id)")[0]
    counts = sheet.get(f"Masseter.handles.get('{name}').chart.series.map(({{ ys }}) => ys)")
    fails, holds = map(sum, counts)
    results = sheet.page.locator("#requirements td .mark").all_text_contents()
    assert not results or (fails, holds) == (results.count("FAIL"), results.count("ok")), (counts, results)
    place = counts[0].index(max(counts[0]))
    [said] = hovered(sheet, name, 0, place)
    assert re.match(rf"{counts[0][place]} \w+, margin −?-?\d+ ", said), said


def tells_a_suite(sheet: Sheet):
    """What failed is first, with a link to its run."""
    assert sheet.page.locator(".panel strong").first.text_content() == "FAILED"
    first = sheet.page.locator("#scenarios tbody tr").first
    assert first.locator("a").get_attribute("href") == "kept/bad/report.html", first.text_content()
    assert sheet.page.locator("#requirements tbody tr .mark").first.text_content() == "FAIL"


def tells_a_study(sheet: Sheet):
    """The pointer on a mean course gives both conditions with their spread; no link has the name of a folder."""
    assert sheet.get("document.querySelectorAll('#section-courses .chart').length") >= 2
    said = hovered(sheet, "course-0", 0, 40)
    assert [line.split("  ")[0] for line in said[1:]] == [
        f"{session}{ending}" for session in ("before", "after") for ending in ("", ", mean + SD", ", mean − SD")], said
    assert sheet.page.locator("#recordings a").count() == 0


def tells_a_campaign(sheet: Sheet):
    """Three factors against the margin, three pairs, a row a reason; a dot says which case it is, and opens the case."""
    assert sheet.get("document.querySelectorAll('#section-margins .chart').length") == 3
    assert sheet.get("document.querySelectorAll('#section-pairs .chart').length") == 3
    reasons = sheet.get("[...document.querySelectorAll('#reasons tbody tr')].map((row) => row.innerText.split('\\t'))")
    failed = [row for row in sheet.get("[...Masseter.handles.values()].flatMap(({ chart }) => chart?.series ?? [])"
                                       ".filter(({ name }) => name === 'did not pass').map(({ xs }) => xs.length)")]
    assert len(reasons) < sum(int(row[1]) for row in reasons) == max(failed), (reasons, failed)
    name = sheet.get("document.querySelector('#section-margins .block-chart').id")
    said = hovered(sheet, name, 0, 0)
    assert re.match(r"case \d+, PASS, margin ", said[0]), said
    case = sheet.get(f"Masseter.handles.get('{name}').chart.series[0].links[0]")
    assert Path(FOLDER / "campaign" / case).exists(), case


def opens_a_case(browser, path: Path):
    """A click on a dot."""
    sheet = Sheet(browser, path)
    name = sheet.get("document.querySelector('#section-margins .block-chart').id")
    hovered(sheet, name, 0, 0)
    sheet.page.mouse.down()
    with sheet.page.expect_navigation():
        sheet.page.mouse.up()
    assert re.search(r"/(cases/\w+/result\.json|worst/[^/]+/report\.html)$", sheet.page.url), sheet.page.url
    sheet.page.context.close()


def main():
    stop = FOLDER / "stop.toml"
    FOLDER.mkdir(parents=True, exist_ok=True)
    stop.write_text("name = 'stop'\nduration_s = 4.0\n[[faults]]\nkind = 'disconnect'\nbus = 1\nnode = 5\nfrom_s = 2.2\n")
    failing = FOLDER / "failing.toml"
    required = "".join(f"[[require]]\nname = '{name}'\nsignal = 'incisal.error'\nduring = 'running'\n{limit}\n"
                       for name, limit in (("near", "max = '5 mm'"), ("close", "statistic = 'rms'\nmax = '2 um'")))
    failing.write_text("name = 'failing'\nduration_s = 3.0\n" + required)
    halted, killed = FOLDER / "halted.toml", FOLDER / "killed.toml"
    halted.write_text("name = 'halted'\nduration_s = 3.0\n[[stimulus]]\nat_s = 1.0\nstop = true\n")
    killed.write_text("name = 'killed'\nduration_s = 2.0\n[[faults]]\nkind = 'controller_kill'\nat_s = 1.0\n")
    chewing, stopped = run("chewing"), run("stopped", str(stop), code=5)
    failed, interrupted = run("failed", str(failing), code=1), run("halted", str(halted), code=130)
    died, invalid = run("died", str(killed), code=4, clock="lockstep"), spoiled("invalid")
    long = run("long", "--duration", "60")
    # A run in real time has a date; a run in simulated time is the same on every machine.
    dated = FOLDER / "dated.html"
    dated.write_text(chewing.read_text().replace('"wall_s":null', '"wall_s":1790250400.25'))
    food = run("food", "examples/food.toml")
    varied, tested, compared = campaign(), suite(), study()
    size_mb = long.stat().st_size / 1e6
    assert size_mb <= LARGEST_MB, f"60 s take {size_mb:.2f} MB"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        short, longest = loads_fast(browser, chewing), loads_fast(browser, long)
        sheet = Sheet(browser, chewing)
        for check in (draws_every_chart, follows_the_pointer, zooms, toggles_curves_and_time, saves, plays, shows_the_jaw_in_space,
                      shows_the_paths_of_the_jaw, counts_the_cycles, fits_the_screen, is_accessible):
            check(sheet)
        goes_on(sheet)
        sheet.close()
        for path, settings, checks in (
            (long, {}, [keeps_extremes, draws_bands]),
            (failed, {}, [shows_what_was_judged]),
            (stopped, {}, [opens_around_the_stop]),
            (dated, {}, [tells_wall_time]),
            (varied, {}, [tells_a_campaign, counts_margins, follows_links, fits_the_screen, is_accessible, prints]),
            (tested, {}, [tells_a_suite, counts_margins, follows_links, fits_the_screen, is_accessible, prints]),
            (compared, {}, [tells_a_study, fits_the_screen, is_accessible, prints]),
            *((path, {"viewport": PHONE, "is_mobile": True, "color_scheme": "dark"}, [fits_the_screen, is_dark, is_accessible])
              for path in (varied, tested, compared)),
            (food, {}, [bites, is_accessible]),
            (stopped, {}, [marks_the_stop, draws_every_chart, prints]),
            (chewing, {"color_scheme": "dark"}, [is_dark, is_accessible, prints]),
            (stopped, {"viewport": PHONE, "has_touch": True, "is_mobile": True}, [fits_the_screen, pinches, is_accessible]),
        ):
            sheet = Sheet(browser, path, **settings)
            for check in checks:
                check(sheet)
            sheet.close()
        names_its_view(browser, chewing)
        opens_a_case(browser, varied)
        for path, words, next_step in (
            (failed, "failed: close: rms of incisal.error", "the limit in [[require]]"),
            (stopped, "process data missing", "set expect.verdict to safe_stop"),
            (died, "SIGKILL", "set expect.verdict to died"),
            (interrupted, "stopped by stimulus 1", "set expect.verdict to interrupted"),
            (invalid, "allows no lost cycle", "then repeat the run"),
            (long, "every check passed", ""),
        ):
            dark = [{"color_scheme": "dark"}] if path == failed else []
            for settings in ({}, {"viewport": PHONE, "is_mobile": True}, *dark):
                sheet = Sheet(browser, path, **settings)
                is_told_first(sheet, words, next_step)
                fits_the_screen(sheet)
                sheet.close()
        browser.close()
    print(f"page: 10 s load in {short:.2f} times a reference; 60 s take {size_mb:.2f} MB and load in {longest:.2f} times it")


main()
