"""Writes terminal.png, report.png and jaw.png into a folder: scripts/pictures.py MASSETER BROWSER FOLDER

The runs are in simulated time, so that their figures are the same on every machine. `pyte` renders what a user sees on the
terminal, and a browser without a window draws the pictures.
"""

import os
import pty
import re
import subprocess
import sys
import tempfile
import termios
from html import escape
from itertools import groupby
from pathlib import Path

import pyte

# Wider and higher than all that is said.
COLUMNS, LINES = 122, 20
WIDTH_PX = 1000
MOST_BYTES = 200_000
# The time that a page has for its scripts, ms.
SCRIPTS_MS = 2000

# The report down to the jaw in space, with the jaw open.
CUT_REPORT = """<script>
for (let last = document.getElementById("section-mechanism"); last !== document.body; last = last.parentElement)
  while (last.nextElementSibling) last.nextElementSibling.remove();
Masseter.time.seek(Masseter.time.time.motion_s + 0.55);
</script>"""
# The planes of the jaw's motion, and its rotation over time.
CUT_JAW = """<script>
for (let kept = document.getElementById("section-jaw"); kept !== document.body; kept = kept.parentElement)
  for (const other of [...kept.parentElement.children])
    if (other !== kept && !["SCRIPT", "STYLE"].includes(other.tagName)) other.remove();
for (let last = document.querySelector("#section-jaw .block.chart"); last.id !== "section-jaw"; last = last.parentElement)
  while (last.nextElementSibling) last.nextElementSibling.remove();
</script>"""
# Leaves the height of the page, px, in its document.
MEASURE = """<script>
addEventListener("load", () => document.documentElement.dataset.height = document.documentElement.getBoundingClientRect().height);
</script>"""

STYLE = """
body { margin: 0; padding: 14px 18px; background: #1b1e24; color: #d7dae0; font: 13.2px/1.4 monospace; }
pre { margin: 0; font: inherit; }
b { color: #ffffff; }
.green { color: #6cc66c; } .red { color: #f2777a; } .brown { color: #e0b050; } .cyan { color: #66cccc; }
"""


def play(masseter, folder):
    """Runs masseter on a terminal of its own; returns the screen as it is at the end."""
    arguments = ["run", "--clock", "lockstep", "--out", "run"]
    process, terminal = pty.fork()
    if process == 0:
        termios.tcsetwinsize(0, (LINES, COLUMNS))
        os.chdir(folder)
        # With NO_COLOR or CI set, colours are others than a user's.
        environment = {name: value for name, value in os.environ.items() if name not in ("CI", "NO_COLOR")}
        os.execve(masseter, ["masseter", *arguments], environment | {"TERM": "xterm-256color"})
    screen = pyte.Screen(COLUMNS, LINES)
    stream = pyte.ByteStream(screen)
    stream.feed(f"$ masseter {' '.join(arguments)}\r\n".encode())
    while True:
        try:
            stream.feed(os.read(terminal, 1 << 16))
        except OSError:  # The last process has closed it.
            break
    code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    assert code == 0, (code, *screen.display)
    return screen


def page_of(screen):
    """The screen as a page, without the empty lines at its end."""

    def styled(look, text):
        (colour, is_bold), text = look, escape(text)
        text = f"<b>{text}</b>" if is_bold and colour == "default" else text
        return text if colour == "default" else f'<span class="{colour}">{text}</span>'

    def line(row):
        signs = [screen.buffer[row][column] for column in range(COLUMNS)]
        parts = groupby(signs, key=lambda sign: (sign.fg, sign.bold))
        return "".join(styled(look, "".join(sign.data for sign in part)) for look, part in parts).rstrip()

    text = "\n".join(line(row) for row in range(LINES)).rstrip()
    return f'<!doctype html><meta charset="utf-8"><style>{STYLE}</style><pre>{text}</pre>'


def draw(browser, page, picture):
    """Draws a whole page, whose height a script of the page measures first."""

    def browse(height_px, action):
        with tempfile.TemporaryDirectory() as profile:
            flags = ["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--force-device-scale-factor=1"]
            flags += [f"--window-size={WIDTH_PX},{height_px}", f"--virtual-time-budget={SCRIPTS_MS}"]
            command = [browser, *flags, f"--user-data-dir={profile}", action, page.resolve().as_uri()]
            return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    with page.open("a") as file:
        file.write(MEASURE)
    (height_px,) = re.findall(r'data-height="([0-9]+)', browse(1000, "--dump-dom"))
    browse(height_px, f"--screenshot={picture.resolve()}")
    size = picture.stat().st_size
    assert size < MOST_BYTES, f"{picture} has {size} bytes, at most {MOST_BYTES} are allowed"
    print(f"{picture}: {size} bytes")


def draw_part(browser, report, cut, picture):
    """Draws the part of a report that a script of its page leaves."""
    with report.open("a") as file:
        file.write(cut)
    draw(browser, report, picture)


masseter, browser, pictures = os.path.abspath(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
with tempfile.TemporaryDirectory(prefix="rig-") as folder:
    terminal, report = Path(folder) / "terminal.html", Path(folder) / "run" / "report.html"
    # Another folder's name would make another picture.
    terminal.write_text(page_of(play(masseter, folder)).replace(folder, "/home/you"))
    draw(browser, terminal, pictures / "terminal.png")
    draw_part(browser, report, CUT_REPORT, pictures / "report.png")
    patient = ["run", "examples/patient.toml", "--clock", "virtual", "--quiet"]
    subprocess.run([masseter, *patient, "--out", f"{folder}/patient"], check=True, stdout=subprocess.DEVNULL)
    draw_part(browser, Path(folder) / "patient/report.html", CUT_JAW, pictures / "jaw.png")
