#!/usr/bin/env python3
"""Kills one process of a rig at a random moment between its start and its end, again and again, and counts what the
verdict says by process and part of the run. A negative exit code is the supervisor's own death.

    tests/realtime/moments.py target/release/masseter --kills 500

Fails if a run passes although a process was killed before the end, has no typed end, hangs, or leaves anything in shared memory or in the
runtime folder after `masseter clean`; and if its recording is neither complete nor recoverable. A killed supervisor gives
no verdict: its run is judged by `masseter report`. Only the Python standard library is used.
"""

import argparse
import collections
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from kill import lives, shared_memory_of

ROLES = ("supervisor", "controller", "plant", "recorder")
MOMENTS = ("start", "boot", "motion", "end")
# Longest time from a kill to the end of all processes of the rig, s.
END_S = 30.0
# The lock that all rigs of a user share stays.
TURN = ".turn"
VERIFY_CODES = {0: "complete", 6: "cut short"}
PASSED = "PASS"


def children_of(rig):
    """Process ids of the rig's parts by role."""
    found = {}
    try:
        children = Path(f"/proc/{rig.pid}/task/{rig.pid}/children").read_text().split()
    except FileNotFoundError:
        return found
    for child in children:
        try:
            arguments = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if len(arguments) > 1:
            found[arguments[1].decode(errors="replace")] = int(child)
    return found


def start(masseter, run, runtime, motion="1s"):
    """A rig without a terminal whose locks and sockets are in a folder of their own; returns its environment too."""
    environment = {**os.environ, "XDG_RUNTIME_DIR": str(runtime)}
    words = [masseter, "run", "--clock", "rt", "--duration", motion, "--quiet", "--out", run]
    return subprocess.Popen(
        words, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ), environment


def usual_length_s(masseter):
    """Wall time of a run that nobody kills."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        rig, _ = start(masseter, Path(folder) / "run", folder)
        rig.wait(timeout=120)
        return time.monotonic() - began


def moment_of(run, children):
    """Part of the run that its processes and its recording show. At the end only the supervisor is left."""
    recording = run / "recording.mcap"
    if not recording.exists():
        return "start"
    if not any(lives(child) for child in children.values()):
        return "end"
    events = run / "events.jsonl"
    text = events.read_text(errors="replace") if events.exists() else ""
    return "motion" if recording.stat().st_size > 400_000 or "running" in text else "boot"


def word_of(masseter, run, environment):
    """The verdict's word, which a run without a supervisor gets from `masseter report`."""
    summary = run / "summary.json"
    if summary.exists():
        return json.loads(summary.read_text())["verdict"]["word"]
    if not run.exists():
        return "no folder"
    result = subprocess.run([masseter, "report", run], env=environment, capture_output=True, text=True)
    if summary.exists():
        return "report: " + json.loads(summary.read_text())["verdict"]["word"]
    if result.returncode in (0, 101) or result.returncode < 0:
        raise SystemExit(f"`masseter report` of {run} ended with {result.returncode}: {result.stderr}")
    return f"report: refused ({result.returncode})"


def kill_once(masseter, role, after_s):
    """Returns the moment and the verdict's word; none if the process was not there."""
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as runtime:
        run = Path(folder) / "run"
        rig, environment = start(masseter, run, runtime)
        time.sleep(after_s)
        children = children_of(rig)
        victim = rig.pid if role == "supervisor" else children.get(role)
        moment = moment_of(run, children)
        was_there = rig.poll() is None and victim is not None and lives(victim)
        if was_there:
            os.kill(victim, signal.SIGKILL)
        deadline = time.monotonic() + END_S + 15
        while rig.poll() is None or any(lives(child) for child in children.values()):
            if time.monotonic() > deadline:
                raise SystemExit(f"{role} killed in {moment}: a process still runs after {END_S:.0f} s")
            time.sleep(0.01)
        if role == "supervisor":
            subprocess.run([masseter, "clean"], env=environment, check=True, stdout=subprocess.DEVNULL)
        kept = [path for path in Path(runtime).rglob("*") if not path.is_dir() and path.name != TURN]
        left = shared_memory_of(rig.pid) + kept
        if left:
            raise SystemExit(f"{role} killed in {moment}: {left} stayed")
        if not was_there:
            return None
        word = f"exit {rig.returncode}, {word_of(masseter, run, environment)}"
        recording = run / "recording.mcap"
        if recording.exists():
            verified = subprocess.run([masseter, "recording", "verify", recording], capture_output=True, text=True)
            if verified.returncode not in VERIFY_CODES:
                raise SystemExit(f"{role} killed in {moment}: recording verify ended with {verified.returncode}: {verified.stderr}")
            word += f", recording {VERIFY_CODES[verified.returncode]}"
            recovered = Path(folder) / "recovered.mcap"
            words = [masseter, "recording", "recover", recording, "--out", recovered]
            if verified.returncode and subprocess.run(words, capture_output=True).returncode:
                raise SystemExit(f"{role} killed in {moment}: the recording cannot be recovered")
        if role != "supervisor" and rig.returncode not in range(1, 7):
            raise SystemExit(f"{role} killed in {moment}, and the rig ended with {rig.returncode}")
        # A supervisor that only writes the report may be killed: the run is over.
        if moment != "end" and (PASSED in word or rig.returncode == 0):
            raise SystemExit(f"{role} killed in {moment}, and the rig says {word}")
        return moment, word


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--kills", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    masseter, chance = arguments.masseter.resolve(), random.Random(arguments.seed)
    length_s = usual_length_s(masseter)
    print(f"an undisturbed run takes {length_s:.1f} s")
    counts, absent = collections.Counter(), 0
    while counts.total() < arguments.kills:
        role = chance.choice(ROLES)
        ended = kill_once(masseter, role, chance.uniform(0.0, length_s))
        if ended is None:
            absent += 1
            continue
        counts[role, *ended] += 1
    print(f"{counts.total()} processes killed; {absent} times the process had not started or was over")
    in_order = sorted(counts, key=lambda key: (ROLES.index(key[0]), MOMENTS.index(key[1]), key[2]))
    for role, moment, word in in_order:
        print(f"{role:<10}  {moment:<6}  {counts[role, moment, word]:>3} × {word}")


if __name__ == "__main__":
    main()
