"""A recording in Rerun's viewer, as `examples/show_in_rerun.py` shows it: the whole mechanism stands in its view, and every plot
has its curves. The viewer is the one for browsers, which draws without a graphics card.

Usage: rerun_viewer.py MASSETER FOLDER [CHROMIUM [PICTURE]]
"""

import runpy
import socket
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import rerun_cli
from PIL import Image
from playwright.sync_api import sync_playwright

MASSETER, FOLDER = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
BROWSER = sys.argv[3] if len(sys.argv) > 3 else None
SHOWN = Path(sys.argv[4]) if len(sys.argv) > 4 else FOLDER / "rerun.png"
SCRIPT = Path(__file__).parents[2] / "examples" / "show_in_rerun.py"
PLOTS = runpy.run_path(SCRIPT, run_name="example")["PLOTS"]
# A short recording loads faster.
DURATION = "2s"
WIDTH, HEIGHT, SCENE_WIDTH = 1280, 900, 512
TOP, BOTTOM = 64, 28
SOFTWARE = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]
LONGEST_S = 60.0
# Colours of the scene, and pixels that they have at least.
PARTS = {"jaw": ((204, 51, 51), 100), "legs": ((115, 115, 128), 500), "rails": ((0, 115, 178), 50)}
# Pixels of a curve, whose edges are mixed with white; the signs of a legend have fewer. The rest of a plot is grey.
CURVE, COLOURED = 500, 60


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


@contextmanager
def viewer(recording):
    """Serves the viewer and a recording; the page's address."""
    web, data = free_port(), free_port()
    ports = ["--web-viewer-port", str(web), "--port", str(data), "--bind", "127.0.0.1"]
    log = (FOLDER / "rerun.log").open("w")
    # The program itself: the script of this name in the folder of programs does not end its child.
    program = Path(rerun_cli.__file__).parent / "rerun"
    server = subprocess.Popen([program, recording, "--serve-web", *ports], stdout=log, stderr=log)
    try:
        until(lambda: socket.create_connection(("127.0.0.1", web)).close() or True, OSError)
        yield f"http://127.0.0.1:{web}/?url=rerun%2Bhttp://127.0.0.1:{data}/proxy&theme=light&hide_welcome_screen=true"
    finally:
        server.terminate()
        server.wait()


def until(is_so, refused=AssertionError):
    """Repeats what is refused at first; the last refusal is the error."""
    gives_up = time.monotonic() + LONGEST_S
    while True:
        try:
            return is_so()
        except refused:
            if time.monotonic() > gives_up:
                raise
            time.sleep(0.3)


def look(page):
    """Judges what the viewer shows."""
    page.screenshot(path=SHOWN)
    seen = np.array(Image.open(SHOWN).convert("RGB"))[TOP : HEIGHT - BOTTOM]

    def pixels(of, color):
        return np.argwhere((of == color).all(axis=2))

    scene, plots = seen[:, :SCENE_WIDTH], seen[:, SCENE_WIDTH:]
    for part, (color, least) in PARTS.items():
        found = pixels(scene, color)
        assert len(found) >= least, f"the {part} have {len(found)} pixels"
        (high, left), (low, right) = found.min(axis=0), found.max(axis=0)
        assert high > 0 and left > 0 and low < len(scene) - 1 and right < SCENE_WIDTH - 1, f"the {part} are cut off"
    for (title, *_), plot in zip(PLOTS, np.array_split(plots, len(PLOTS))):
        found = np.count_nonzero(np.ptp(plot.astype(int), axis=2) > COLOURED)
        assert found >= CURVE, f"'{title}' has {found} coloured pixels"
    return True


run, file = FOLDER / "shown", FOLDER / "shown.rrd"
play = [MASSETER, "run", "--clock", "virtual", "--quiet", "--duration", DURATION, "--out", run]
subprocess.run(play, check=True, stdout=subprocess.DEVNULL)
subprocess.run([sys.executable, SCRIPT, run, "--save", file], check=True)
began_s = time.monotonic()
with viewer(file) as address, sync_playwright() as playwright:
    browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", *SOFTWARE])
    page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
    page.goto(address)
    until(lambda: look(page))
    browser.close()
print(f"Rerun shows a recording after {time.monotonic() - began_s:.0f} s")
