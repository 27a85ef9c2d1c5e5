#!/usr/bin/env python3
"""Stops controller and plant of a running rig for moments, again and again. The motion waits and goes on. The last gate
refuses a command only where a stall left a target more than two periods behind, which is rare.

    tests/realtime/stalls.py target/release/masseter --runs 10

Fails if the gate refuses more than one command in 500 stalls, or one that no stall explains. Other stops of so disturbed a
rig are only counted. Only the Python standard library is used.
"""

import argparse
import collections
import json
import os
import random
import signal
import tempfile
import time
from pathlib import Path

from rig import children_of, start

REFUSALS = {"bad_message", "stroke_limit", "velocity_limit", "acceleration_limit"}
STALLS_S = (0.001, 0.002, 0.004, 0.008)
LONGEST_PAUSE_S = 0.06
MOTION_S = 5.0
# A rig that ends after few stalls shows nothing.
LEAST_STALLS = 50
STALLS_PER_REFUSAL = 500


def stall(victims, chance):
    """Stops one process for a moment; returns whether it was there."""
    try:
        victim = chance.choice(victims)
        os.kill(victim, signal.SIGSTOP)
        time.sleep(chance.choice(STALLS_S))
        os.kill(victim, signal.SIGCONT)
        return True
    except ProcessLookupError:
        return False


def run_once(masseter, chance):
    """Returns the verdict's word, the cause of the first fault, the stalls, and the refused commands."""
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"
        rig = start(masseter, run, "rt", "--duration", f"{MOTION_S}s", runtime=folder)
        while rig.poll() is None and not {"controller", "plant"} <= children_of(rig).keys():
            time.sleep(0.01)
        children, stalls = children_of(rig), 0
        victims = [children[role] for role in ("controller", "plant") if role in children]
        while rig.poll() is None and victims and stall(victims, chance):
            stalls += 1
            time.sleep(chance.uniform(0.002, LONGEST_PAUSE_S))
        rig.wait(timeout=60)
        summary = json.loads((run / "summary.json").read_text())
        faults = [event for event in summary["figures"]["events"] if event["kind"] == "fault"]
        refused = [fault for fault in faults if fault["cause"] in REFUSALS]
        return summary["verdict"]["word"], faults[0]["cause"] if faults else "no fault", stalls, refused


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    masseter, chance = arguments.masseter.resolve(), random.Random(arguments.seed)
    ends, all_stalls, all_refused = collections.Counter(), 0, []
    for _ in range(arguments.runs):
        word, cause, stalls, refused = run_once(masseter, chance)
        ends[word, cause] += 1
        all_stalls += stalls
        all_refused += refused
        if refused and word != "INVALID":
            raise SystemExit(f"no stall explains that the gate refused a command: {refused}")
    for (word, cause), count in ends.most_common():
        print(f"{count:>3} × {word}, {cause}")
    print(f"{all_stalls} stalls in {arguments.runs} runs, {len(all_refused)} refused commands")
    if all_stalls < LEAST_STALLS * arguments.runs:
        raise SystemExit("the rigs ended too early to show anything")
    if len(all_refused) > max(1, all_stalls // STALLS_PER_REFUSAL):
        raise SystemExit(f"the gate refused commands of the rig: {all_refused}")


if __name__ == "__main__":
    main()
