"""Looks at a run on a terminal: `pyte` renders what a user sees.

The progress is rewritten in its line, and the verdict stands readable below it. A line wider than the terminal does not wrap.
The verdict of a stop is the last line on a terminal of 24 lines. The terminal is left as it was after a run, after Ctrl-C, with
--quiet and on a terminal that only prints. The test fails where this is not so, and when words are coloured against NO_COLOR or --color, or are not where
--color asks for it.
"""

import os
import pty
import re
import signal
import sys
import tempfile
import termios
import time
from pathlib import Path

import pyte

# Narrower than the line of the progress, and longer than everything that is said.
COLUMNS, LINES = 80, 300
INTERRUPTED = 130
SAFE_STOP = 5
LENIENT = Path(__file__).parents[1] / "lenient.toml"
# Passed, too disturbed to judge, or incomplete because the machine starved the recorder: this judges the terminal.
ACCEPTED = (0, 3, 6)
PROGRESS = "tracking error"
# Variables that decide whether words are coloured.
CHOOSE_COLOUR = ("CI", "NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE")
# The part of the line that fits into these columns.
MOTION = re.compile(r"motion +[0-9.]+ of [0-9.]+ s")
GREEN_OR_AMBER = ("\x1b[1m\x1b[32m", "\x1b[1m\x1b[33m")
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
VERDICTS = ("PASS: ", "INVALID: ", "INCOMPLETE: ", "INTERRUPTED: ")


def run(masseter, arguments, term="xterm-256color", interrupt_after=None, clock="rt", scenario=LENIENT, **more):
    """Runs on a terminal of its own; returns exit code, output and what stands on the screen."""
    with tempfile.TemporaryDirectory() as folder:
        command = [masseter, "run", str(scenario), "--clock", clock, "--out", str(Path(folder) / "run"), *arguments]
        process, terminal = pty.fork()
        if process == 0:
            # With CI set, colours are printed on every terminal: this looks at a user's.
            others = {name: value for name, value in os.environ.items() if name not in CHOOSE_COLOUR}
            environment = others | {"TERM": term, **more}
            os.execve(masseter, command, environment)
        termios.tcsetwinsize(terminal, (LINES, COLUMNS))
        before = termios.tcgetattr(terminal)
        output, interrupted = b"", interrupt_after is None
        while True:
            try:
                output += os.read(terminal, 1 << 16)
            except OSError:  # The last process has closed it.
                break
            if not interrupted and interrupt_after in output.decode(errors="replace"):
                time.sleep(0.5)
                os.write(terminal, b"\x03")
                interrupted = True
            assert termios.tcgetattr(terminal) == before, "the terminal's modes were changed"
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
    screen = pyte.HistoryScreen(COLUMNS, LINES, history=10_000)
    pyte.ByteStream(screen).feed(output)
    assert pyte.modes.DECAWM in screen.mode and not screen.cursor.hidden, "the terminal was not left as it was"
    scrolled = ["".join(line[column].data for column in range(COLUMNS)) for line in screen.history.top]
    return code, output.decode(), [line.rstrip() for line in scrolled + screen.display]


def assert_one_line_above_a_verdict(shown):
    lines = [number for number, line in enumerate(shown) if MOTION.search(line)]
    verdicts = [number for number, line in enumerate(shown) if line.startswith(VERDICTS)]
    assert len(lines) == 1, "\n".join(shown)
    assert len(verdicts) == 1 and verdicts[0] > lines[0], "\n".join(shown)


def has_coloured_verdict(output):
    return any(line.startswith(GREEN_OR_AMBER) for line in output.splitlines())


signal.alarm(120)
masseter = os.path.abspath(sys.argv[1])

code, output, shown = run(masseter, ["--duration", "3s"])
assert code in ACCEPTED, (code, output)
assert output.count(PROGRESS) >= 2, "the line was not rewritten"
assert_one_line_above_a_verdict(shown)
print("\n".join(line for line in shown if line))

code, output, shown = run(masseter, ["--duration", "60s"], interrupt_after="running")
assert code == INTERRUPTED, (code, output)
assert_one_line_above_a_verdict(shown)

code, output, shown = run(masseter, ["--duration", "10s"], term="dumb")
assert code in ACCEPTED and "\x1b" not in output and PROGRESS in output, (code, output)

code, output, shown = run(masseter, ["--duration", "1s", "--quiet"])
assert code in ACCEPTED and has_coloured_verdict(output) and PROGRESS not in output, output

for arguments, environment, term, is_coloured in [
    (["--color", "never"], {}, "xterm-256color", False),
    ([], {"NO_COLOR": "1"}, "xterm-256color", False),
    (["--color", "always"], {"NO_COLOR": "1"}, "xterm-256color", True),
    (["--color", "always"], {}, "dumb", True),
]:
    code, output, shown = run(masseter, ["--duration", "1s", "--quiet", *arguments], term, clock="virtual", **environment)
    case = (arguments, environment, term, output)
    assert code in ACCEPTED and PROGRESS not in output, case
    assert has_coloured_verdict(output) if is_coloured else "\x1b" not in output, case

# After a stop the last screen has the verdict with its reason, once, and the times of the motion.
with tempfile.TemporaryDirectory() as folder:
    scenario = Path(folder) / "stop.toml"
    scenario.write_text("duration_s = 3.0\n[[faults]]\nkind = 'jam'\naxis = 'l2'\nfrom_s = 1.8\n")
    code, output, shown = run(masseter, ["--quiet"], clock="virtual", scenario=scenario)
while not shown[-1]:
    shown.pop()
screen = "\n".join(shown[-24:])
assert code == SAFE_STOP and shown[-1] == "timing: simulated", (code, screen)
assert any(line.startswith("SAFE STOP: ") for line in shown[-10:]) and "FAIL sequence" in screen, screen
assert COLOUR.sub("", output).count("following_error") == 1 and re.search(r"\n +0\.5\d\d s  controller: ", output), output

# The line of the progress is rewritten without colours, too.
code, output, shown = run(masseter, ["--duration", "2s"], NO_COLOR="1")
assert code in ACCEPTED and not COLOUR.search(output) and output.count(PROGRESS) >= 2, (code, output)
assert_one_line_above_a_verdict(shown)
