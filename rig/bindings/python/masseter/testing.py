"""The fixture `masseter` of pytest, which is there wherever the package is installed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from masseter.rig import Result, run


@pytest.fixture
def masseter(tmp_path: Path) -> Callable[..., Result]:
    """Plays a scenario with the arguments of masseter.run, in virtual time unless `clock` is given.

        def test_soft_food(masseter):
            masseter("soft_food.toml", set={"parameters.gain": 3})

    The test fails with the verdict and each check that did not pass, with its moment and margin. The run folder is in the test's
    temporary folder, which pytest keeps.
    """
    played = 0

    def play(*arguments: Any, **named: Any) -> Result:
        nonlocal played
        played += 1
        result = run(*arguments, **{"clock": "virtual", "keep": tmp_path / f"run-{played}", **named})
        if not result.passed:
            pytest.fail(f"{result}\nreport: {result.folder / 'report.html'}", pytrace=False)
        return result

    return play
