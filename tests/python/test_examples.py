"""The controllers of examples/controllers: each meets what its scenario requires, and fails it with a bad gain."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import masseter

CONTROLLERS = Path(__file__).parents[2] / "examples" / "controllers"
MOST_LINES = 90


def play(name: str, folder: Path, gains: dict[str, float]) -> dict[str, Any]:
    """The checks of a run by their names."""
    # The example is started as its first lines say, by this Python with its modules.
    program = folder / "program.py"
    path = str(CONTROLLERS / f"{name}.py")
    program.write_text(f"import runpy, sys\nsys.path[:0] = {sys.path!r}\nrunpy.run_path({path!r}, run_name='__main__')\n")
    result = masseter.run(CONTROLLERS / f"{name}.toml", f"{sys.executable} '{program}'", set=gains)
    return {check["name"]: check["result"] for check in result.summary["verdict"]["checks"]} | {"verdict": result.verdict}


@pytest.mark.parametrize(
    ("name", "gains", "failed"),
    [
        ("lqr", {"effort": 1e9}, "the jaw keeps to its path"),
        ("impedance", {"stiffness": 1000.0}, "a gentle bite"),
        ("impedance", {"stiffness": 0.1}, "the jaw bites"),
    ],
)
def test_an_example_meets_its_requirements_and_a_bad_gain_fails_one(
    name: str, gains: dict[str, float], failed: str, tmp_path: Path
) -> None:
    assert len((CONTROLLERS / f"{name}.py").read_text().splitlines()) <= MOST_LINES
    good = play(name, tmp_path, {})
    assert good["verdict"] == "PASS" and good[failed] == "passed", good
    bad = play(name, tmp_path, gains)
    assert bad["verdict"] == "FAIL", bad
    assert [check for check, result in bad.items() if result == "failed"] == [failed], bad


def test_a_regulator_that_spares_no_effort_is_stopped_safely(tmp_path: Path) -> None:
    # The drives follow later than its model says.
    assert play("lqr", tmp_path, {"effort": 1.0})["verdict"] == "SAFE STOP"
