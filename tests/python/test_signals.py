"""What a program declares, listed before a run."""

import subprocess
import sys
from pathlib import Path

import pytest

DECLARES = """\
import sys
sys.path[:0] = {path!r}
import masseter
masseter.control(
    lambda demand: demand.ahead,
    signals=[masseter.Signal("vz", "mm/s", "Vertical speed.")],
    parameters=[masseter.Parameter("gain", 1.0, (0.0, 10.0), "1/s", "Of the law.")],
)
"""


def listed(command: str, program: Path, text: str, *arguments: str) -> "subprocess.CompletedProcess[str]":
    program.write_text(text)
    words = [command, "signals", "--controller", f"python3 '{program}'", *arguments]
    return subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)


def test_own_signals_and_parameters_are_listed_with_their_units(masseter_command: str, tmp_path: Path) -> None:
    done = listed(masseter_command, tmp_path / "my law.py", DECLARES.format(path=sys.path))
    lines = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line}
    assert done.returncode == 0, done.stderr
    assert lines["signal.vz"] == ["mm/s", "Vertical", "speed."] and lines["parameter.gain"][0] == "1/s"
    assert "states of controller.state: " in done.stdout and "running" in done.stdout


@pytest.mark.parametrize(
    ("text", "said"),
    [("print('no rig here')", "ended (exit code 0) before it was ready"), ("raise SystemExit(3)", "ended (exit code 3) before it was ready")],
)
def test_a_program_that_leaves_is_named(masseter_command: str, tmp_path: Path, text: str, said: str) -> None:
    done = listed(masseter_command, tmp_path / "leaves.py", text)
    assert (done.returncode, done.stdout) == (2, "") and said in done.stderr, done.stderr


def test_the_rig_starts_the_program_itself(masseter_command: str) -> None:
    words = [masseter_command, "signals", "--controller", "external"]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2 and "a controller that it starts" in done.stderr, done.stderr
