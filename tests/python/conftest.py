"""The command under test, and what real time may take from a run."""

import os

import pytest

import masseter


@pytest.fixture
def masseter_command() -> str:
    return os.environ["MASSETER"]


def stands_but_for_time(result: masseter.Result) -> bool:
    """Whether nothing but time is against a run in real time.

    A busy machine takes cycles, and the run is not judged. An interpreter that computes for too long in one cycle fails the timing;
    where that is longer than the master waits for a command, the rig stops safely.
    """
    verdict = result.summary["verdict"]
    failed = {check["name"] for check in verdict.get("checks", []) if check["result"] == "failed"}
    faults = [event["cause"] for event in result.summary["figures"]["events"] if event["kind"] == "fault"]
    is_late = verdict["timing"]["word"] in ("missed", "disturbed")
    has_lost_a_command = result.exit_code == 5 and is_late and faults[:1] == ["command_lost"]
    return result.exit_code in (0, 3) or failed == {"timing"} or has_lost_a_command
