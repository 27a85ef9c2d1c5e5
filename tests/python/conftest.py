"""The command under test, and what real time may take from a run."""

import os

import pytest

import masseter


@pytest.fixture
def masseter_command() -> str:
    return os.environ["MASSETER"]


def stands_but_for_time(result: masseter.Result) -> bool:
    """Whether nothing but time is against a run in real time.

    A busy machine takes cycles, and the run is not judged. An interpreter that computes for too long in one cycle fails the timing.
    """
    failed = {check["name"] for check in result.summary["verdict"].get("checks", []) if check["result"] == "failed"}
    return result.exit_code in (0, 3) or failed == {"timing"}
