#!/usr/bin/env python3
"""Kills or stops each process of a rig in turn, at random moments between start and end, and counts by process and part
of the run what the verdict says. A negative exit code is the supervisor's own death.

The recorder is hit when the recording has a random share of its length: at a random time it often has not begun.

    tests/realtime/moments.py target/release/masseter --times 800
    tests/realtime/moments.py target/release/masseter --times 800 --clock lockstep --signal STOP --busy 4
    tests/realtime/moments.py target/release/masseter --times 100 --clock lockstep --signal NONE --busy 4

Every trial ends with a verdict within its time, and leaves nothing in shared memory or in the runtime folder. Its
recording is complete or can be recovered. No run passes whose process was killed before the end. A killed supervisor
gives no verdict: `masseter report` judges its run.

In simulated time, a run that passes has the bytes and the digest of an undisturbed run under virtual time. So has every
run whose process stopped for less than the patience, and the recording of a killed recorder is their beginning. With
NONE no process is hit: all runs must be equal. With --busy, so many processes that never sleep run beside every second
rig, or beside all with NONE. Only the Python standard library is used.
"""

import argparse
import collections
import contextlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rig import children_of, lives, shared_memory_of, start

ROLES = ("supervisor", "controller", "plant", "recorder")
MOMENTS = ("start", "boot", "motion", "end", "whole run")
MOTION = "1s"
PATIENCE_S = 1.0
# A stop is either shorter than the patience, or longer than the patience of all processes in turn.
SHORT_S, LONG_S = (0.0, PATIENCE_S / 2), (3 * PATIENCE_S, 4 * PATIENCE_S)
# Longest time from the signal to the end of all processes of the rig, s.
END_S = 45.0
# The share of the recorder's hits that come before anything is recorded, against those after that.
BEGINNING = 0.1
# The lock that all rigs of a user share stays.
TURN = ".turn"
VERIFY_CODES = {0: "complete", 6: "cut short"}
TYPED = range(1, 7)
PASSED = "PASS"

# What is left of a run: its exit code, the verdict's word and reason, its digest, the recording, and how that verifies.
End = collections.namedtuple("End", "code word reason digest recording verified")


class Rigs:
    """Starts rigs of one kind, and judges how each ends."""

    def __init__(self, masseter, clock, how):
        self.masseter, self.clock, self.how = masseter, clock, how
        # In real time no two runs are equal.
        self.reference = None if clock == "rt" else self.undisturbed("virtual")[1]
        if self.reference and not (self.reference.code == 0 and self.reference.word == PASSED):
            raise SystemExit(f"the reference did not pass: {self.reference.word}: {self.reference.reason}")

    def options(self, clock):
        is_impatient = clock == "lockstep" and self.how == "STOP"
        return ["--duration", MOTION, *(["--patience", f"{PATIENCE_S}s"] if is_impatient else [])]

    def undisturbed(self, clock):
        """A run that nothing hits: its time, s, and its end."""
        with tempfile.TemporaryDirectory() as folder:
            run, began = Path(folder) / "run", time.monotonic()
            rig = start(self.masseter, run, clock, *self.options(clock), runtime=folder)
            rig.wait(timeout=END_S)
            return time.monotonic() - began, self.end_of(rig, run, dict(os.environ))

    def hit(self, role, after_s, recorded_bytes, stop_s):
        """Hits a process after a time and once so much is recorded. Returns the moment and how the run ended; none if the
        process was not there."""
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as runtime:
            run, how = Path(folder) / "run", self.how
            rig = start(self.masseter, run, self.clock, *self.options(self.clock), runtime=runtime)
            time.sleep(after_s)
            children = self.wait_until_recorded(rig, run, recorded_bytes)
            victim = rig.pid if role == "supervisor" else children.get(role)
            moment = moment_of(run, children, self.clock)
            was_there = rig.poll() is None and victim is not None and lives(victim)
            if was_there:
                was_there = send(victim, how, stop_s)
                # The run may have gone on until the signal came.
                moment = "end" if moment_of(run, children, self.clock) == "end" and role == "supervisor" else moment
            self.wait(rig, children, f"{role} hit by SIG{how} in {moment}")
            environment = {**os.environ, "XDG_RUNTIME_DIR": runtime}
            if role == "supervisor" and how == "KILL":
                subprocess.run([self.masseter, "clean"], env=environment, check=True, stdout=subprocess.DEVNULL)
            kept = [path for path in Path(runtime).rglob("*") if not path.is_dir() and path.name != TURN]
            left = shared_memory_of(rig.pid) + kept
            if left:
                raise SystemExit(f"{role} hit by SIG{how} in {moment}: {left} stayed")
            return (moment, self.end_of(rig, run, environment)) if was_there else None

    def wait_until_recorded(self, rig, run, recorded_bytes):
        """Returns the processes below the rig, by role. With a number of bytes, even 0, the recorder is among them."""
        recording, deadline = run / "recording.mcap", time.monotonic() + END_S
        while recorded_bytes is not None and rig.poll() is None:
            length = recording.stat().st_size if recording.exists() else 0
            if length >= recorded_bytes and "recorder" in children_of(rig):
                break
            if time.monotonic() > deadline:
                raise SystemExit(f"after {END_S:.0f} s there are {length} of {recorded_bytes} bytes")
            time.sleep(0.0005)
        return children_of(rig)

    def wait(self, rig, children, what):
        deadline = time.monotonic() + END_S
        while rig.poll() is None or any(lives(child) for child in children.values()):
            if time.monotonic() > deadline:
                raise SystemExit(f"{what}: a process still runs after {END_S:.0f} s")
            time.sleep(0.01)

    def end_of(self, rig, run, environment):
        """What a run left. `masseter report` judges a run without a supervisor."""
        recording, summary, reported = run / "recording.mcap", run / "summary.json", ""
        if not run.exists():
            return End(rig.returncode, "no folder", "", None, b"", "not begun")
        if not summary.exists():
            result = subprocess.run([self.masseter, "report", run], env=environment, capture_output=True, text=True)
            if not summary.exists():
                if result.returncode not in TYPED:
                    raise SystemExit(f"`masseter report` ended with {result.returncode}: {result.stderr}")
                return End(rig.returncode, f"report: refused ({result.returncode})", "", None, b"", self.verify(recording))
            reported = "report: "
        found = json.loads(summary.read_text())
        verdict, verified = found["verdict"], self.verify(recording)
        content = recording.read_bytes() if recording.exists() else b""
        return End(
            rig.returncode, reported + verdict["word"], verdict["reason"], found["figures"]["digest"], content, verified
        )

    def verify(self, recording):
        """How complete a recording is; one that is not can be recovered."""
        if not recording.exists() or recording.stat().st_size == 0:
            return "not begun"
        words = [self.masseter, "recording", "verify", recording]
        verified = subprocess.run(words, capture_output=True, text=True)
        if verified.returncode not in VERIFY_CODES:
            raise SystemExit(f"recording verify ended with {verified.returncode}: {verified.stderr}")
        words = [self.masseter, "recording", "recover", recording, "--out", recording.with_name("recovered.mcap")]
        if verified.returncode and subprocess.run(words, capture_output=True).returncode:
            raise SystemExit("the recording cannot be recovered")
        return VERIFY_CODES[verified.returncode]

    def judge(self, role, moment, stop_s, end):
        """What is wrong with the end of a run; none if nothing is."""
        how = self.how
        has_own_verdict = not (role == "supervisor" and how == "KILL")
        passed = end.code == 0 or PASSED in end.word
        if has_own_verdict and end.code != 0 and end.code not in TYPED:
            return "no typed end"
        # A supervisor that only writes the report may be killed: the run is over. Under virtual time its bytes show that.
        if how == "KILL" and moment != "end" and passed and self.clock != "virtual":
            return "a run passed whose process was killed"
        if self.reference is None:
            return None
        if PASSED in end.word and (end.digest, end.recording) != (self.reference.digest, self.reference.recording):
            return "a run passed with other bytes than the reference"
        waits = how == "NONE" or (how == "STOP" and (role == "supervisor" or stop_s < PATIENCE_S))
        if waits and not (end.code == 0 and PASSED in end.word):
            return "the run did not wait"
        if how == "KILL" and role == "recorder" and not self.reference.recording.startswith(end.recording):
            return "the recording is not the beginning of the reference"
        # Without a reason no process had reported ready.
        if how == "STOP" and end.code and end.reason and not end.reason.startswith(f"the {role} died"):
            return "the reason does not name the stopped process"
        return None


def send(victim, how, stop_s):
    """Kills the process, or stops it for a time; returns whether it was there."""
    try:
        if how == "KILL":
            os.kill(victim, signal.SIGKILL)
        elif how == "STOP":
            os.kill(victim, signal.SIGSTOP)
            time.sleep(stop_s)
            with contextlib.suppress(ProcessLookupError):
                # The supervisor may have killed it.
                os.kill(victim, signal.SIGCONT)
    except ProcessLookupError:
        # Its end came in the last moment.
        return False
    return True


def moment_of(run, children, clock):
    """Part of the run that its processes and its recording show. At the end only the supervisor is left."""
    recording = run / "recording.mcap"
    if not recording.exists():
        return "start"
    if clock != "virtual" and not any(lives(child) for child in children.values()):
        return "end"
    events = run / "events.jsonl"
    text = events.read_text(errors="replace") if events.exists() else ""
    return "motion" if recording.stat().st_size > 400_000 or "running" in text else "boot"


@contextlib.contextmanager
def busy(count):
    """So many processes that never sleep."""
    processes = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--times", type=int, default=500, help="processes that are hit, or runs without a hit")
    parser.add_argument("--clock", choices=["rt", "lockstep", "virtual"], default="rt")
    parser.add_argument("--signal", choices=["KILL", "STOP", "NONE"], default="KILL")
    parser.add_argument("--role", action="append", choices=ROLES, help="only this one")
    parser.add_argument("--busy", type=int, default=0, help="processes that never sleep, beside the rigs")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    how, chance = arguments.signal, random.Random(arguments.seed)
    rigs = Rigs(arguments.masseter.resolve(), arguments.clock, how)
    lengths_s, whole_bytes = [], 0
    for count in (0, arguments.busy):
        with busy(count):
            length_s, end = rigs.undisturbed(arguments.clock)
            lengths_s.append(length_s)
            whole_bytes = len(end.recording)
    roles = ROLES[:1] if arguments.clock == "virtual" or how == "NONE" else arguments.role or ROLES
    counts, quarters, absent, failed = collections.Counter(), collections.Counter(), 0, []
    while counts.total() < arguments.times:
        role = roles[counts.total() % len(roles)]
        is_busy = how == "NONE" or counts.total() // len(roles) % 2 == 1
        # The share of the run's time, or of its recording. A negative share of the recording is its beginning.
        share, recorded_bytes = chance.uniform(0.0, 1.0), None
        if role == "recorder":
            recorded_bytes = max(0.0, share * (1 + BEGINNING) - BEGINNING) * whole_bytes
        after_s = 0.0 if how == "NONE" or role == "recorder" else share * lengths_s[is_busy]
        stop_s = chance.uniform(*chance.choice([SHORT_S, SHORT_S, SHORT_S, LONG_S])) if how == "STOP" else 0.0
        with busy(arguments.busy if is_busy else 0):
            hit = rigs.hit(role, after_s, recorded_bytes, stop_s)
        if hit is None:
            absent += 1
            continue
        moment, end = hit
        if role == "recorder" and how == "KILL":
            quarters[min(4, 1 + 4 * len(end.recording) // whole_bytes) if end.recording else 0] += 1
        wrong = rigs.judge(role, moment, stop_s, end)
        if wrong:
            failed.append(f"{role}, SIG{how} in {moment} for {stop_s:.2f} s: {wrong}: {end.code}, {end.word}: {end.reason}")
        length = "" if how != "STOP" else "long " if stop_s > PATIENCE_S else "short "
        same = "" if rigs.reference is None or rigs.reference.recording != end.recording else ", bytes of the reference"
        word = f"exit {end.code}, {end.word}, recording {end.verified}{same}"
        counts[role if how != "NONE" else "none", length + (moment if how != "NONE" else "whole run"), word] += 1
    alone_s, beside_s = lengths_s
    print(f"an undisturbed run takes {alone_s:.1f} s, beside {arguments.busy} busy processes {beside_s:.1f} s")
    print(f"{counts.total()} trials ({how}, {arguments.clock}); {absent} times the process had not started or was over")
    order = lambda key: (key[0], MOMENTS.index(key[1].split(" ", 1)[-1] if key[1] not in MOMENTS else key[1]), key)
    for role, moment, word in sorted(counts, key=order):
        print(f"{role:<10}  {moment:<12}  {counts[role, moment, word]:>3} × {word}")
    if quarters:
        shares = ", ".join(f"{quarters[quarter]} in quarter {quarter}" for quarter in range(1, 5))
        print(f"the killed recorder's recordings end: {quarters[0]} before their beginning, {shares}")
    if failed:
        sys.exit("\n".join(failed))


if __name__ == "__main__":
    main()
