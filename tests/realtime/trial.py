"""One rig, the hit of one of its processes, and what must hold for what it leaves. `disturbed.py` has the table of all
cases. Only the Python standard library is used."""

import collections
import contextlib
import csv
import json
import os
import random
import signal
import subprocess
import tempfile
import time
from pathlib import Path

from rig import LENIENT, Again, children_of, clean, inside, left_of, lives, require, shared_memory_of, start, wait_for_end

PROCESSES = ("controller", "plant", "recorder")
ROLES = ("supervisor", *PROCESSES)
# At any time from the start to the end of a short run, or while a long one moves.
ANY, MOTION = "any moment", "in motion"
Case = collections.namedtuple("Case", "clock how role moment")
PASSED, DISTURBED, DIED, SAFE_STOP, INCOMPLETE = 0, 3, 4, 5, 6
TYPED = range(7)
DURATION = {ANY: "1s", MOTION: "60s"}
STALLED_RUN = "5s"
# Longest time from the start of a rig to its recording, and of a stalled run, s.
START_S, LONGEST_STALLED_S = 45.0, 120.0
PATIENCE_S = 1.0
# Half of what the recorder's queues hold at 1 kHz.
RECORDER_PAUSE_S = 1.0
# Cycles take twice as long where every other deadline is missed: beyond twice the silence, ms and s.
REACTION_MARGIN_MS, STOP_MARGIN_S = 60.0, 0.28
REACTS, OVER, LACKS, CLEAN = "survivor reacts", "over and swept up", "recording lacks", "made clean"
STALLS, REFUSED = "stalls", "refused commands"
REACTION = {"controller": "command_lost", "plant": "stale_reading"}
MOVING = ("easing", "running", "holding")
WITH_FORCE = {"operation_enabled", "quick_stop_active", "fault_reaction_active"}
# A recording of this length shows that the rig runs.
BEGUN_BYTES = 500_000
# The share of the recorder's hits that come before anything is recorded, against those after that.
BEGINNING = 0.1
STALLS_S, LONGEST_BREAK_S = (0.001, 0.002, 0.004, 0.008), 0.06
REFUSALS = {"bad_message", "stroke_limit", "velocity_limit", "acceleration_limit"}


class Rigs:
    """What all trials share: the program, the silence after which a partner counts as dead, and undisturbed runs."""

    def __init__(self, masseter, silent_cycles):
        self.masseter, self.silent_cycles = masseter, silent_cycles
        self.reaction_ms = 2 * silent_cycles + REACTION_MARGIN_MS
        # Undisturbed runs: their times, s, and the bytes and the digest that all runs in simulated time have.
        self.lengths_s = {}
        for clock in ("rt", "virtual"):
            with Trial(self, Case(clock, "NONE", "none", ANY), 0, random.Random(0)) as trial:
                self.lengths_s[clock] = trial.wait()
                self.recording, self.digest = trial.recording.read_bytes(), trial.summary()["figures"]["digest"]
                require(clock == "rt" or trial.rig.returncode == PASSED, "the reference did not pass")
        # Three processes, beside those of others.
        self.lengths_s["lockstep"] = 2 * self.lengths_s["virtual"]

    def options(self, case):
        if case.clock != "rt":
            patience = ["--patience", f"{PATIENCE_S}s"] if case.how in ("PAUSE", "STOP") else []
            return ["--duration", DURATION[case.moment], *patience]
        if case.how == "STALLS":
            return ["--duration", STALLED_RUN]
        cycles, heartbeat_ms = self.silent_cycles, max(150, 4 * self.silent_cycles)
        sets = [f"controller.stale_cycles={cycles}", f"can.command_timeout_cycles={cycles}"]
        sets += [f"can.heartbeat_consumer_ms={heartbeat_ms}"]
        words = [word for value in sets for word in ("--set", value)]
        return [LENIENT, "--duration", DURATION[case.moment], *words]


class Trial:
    """A rig of its own, and the hit."""

    def __init__(self, rigs, case, number, chance):
        self.rigs, self.case, self.chance, self.measures = rigs, case, chance, {}
        self.name = f"{case.clock} {case.how} {case.role} {case.moment} #{number}"
        self.folder = tempfile.TemporaryDirectory()
        self.runtime = Path(self.folder.name) / "runtime"
        self.runtime.mkdir(mode=0o700)
        self.run = Path(self.folder.name) / "run"
        self.recording = self.run / "recording.mcap"
        self.rig = start(rigs.masseter, self.run, case.clock, *rigs.options(case), runtime=self.runtime)
        self.children = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        # Whatever was wrong, nothing of the trial stays.
        left = [*{**self.children, **children_of(self.rig)}.values(), self.rig.pid]
        left = [process for process in left if lives(process)]
        for process in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        if left:
            wait_for_end(self.rig, left, self.name)
            clean(self.rigs.masseter, self.runtime)
        self.folder.cleanup()

    # The hit.

    def play(self):
        """Returns the moment of the hit, and what became of the run."""
        if self.case.how == "STALLS":
            return self.stall()
        moment = "whole run"
        if self.case.how != "NONE":
            self.wait_for_moment()
            self.children = children_of(self.rig)
            moment = self.moment()
            self.hit()
            if self.case.role == "supervisor" and self.moment() == "end":
                # The run may have gone on until the signal came.
                moment = "end"
        self.measures[OVER] = 1e3 * self.wait()
        return moment, self.judge(moment)

    def wait(self):
        return wait_for_end(self.rig, self.children.values(), self.name)

    def recorded_bytes(self):
        return self.recording.stat().st_size if self.recording.exists() else 0

    def wait_for_moment(self):
        """At a random time a recorder often has not begun, so its recording shall have a random share of its length."""
        share, role = self.chance.random(), self.case.role
        if self.case.moment == MOTION:
            self.wait_for_recording(BEGUN_BYTES)
            time.sleep(share)
            if self.rig.poll() is None:
                files = shared_memory_of(f"{self.rig.pid}-")
                require(files, "a rig without files in shared memory: their absence proves nothing")
        elif role == "recorder":
            self.wait_for_recording(max(0.0, share * (1 + BEGINNING) - BEGINNING) * len(self.rigs.recording))
        else:
            time.sleep(share * self.rigs.lengths_s[self.case.clock])

    def wait_for_recording(self, length):
        """With any length, also zero, there is a recorder."""
        deadline = time.monotonic() + START_S
        while self.recorded_bytes() < length or "recorder" not in children_of(self.rig):
            if self.rig.poll() is not None:
                raise Again
            require(time.monotonic() < deadline, f"the rig does not record {length} bytes")
            time.sleep(0.0005)

    def moment(self):
        """Part of the run that its processes and its recording show. At the end only the supervisor is left."""
        if not self.recording.exists():
            return "start"
        if self.case.clock != "virtual" and not any(lives(child) for child in self.children.values()):
            return "end"
        return "motion" if self.recorded_bytes() > BEGUN_BYTES else "boot"

    def hit(self):
        role, how = self.case.role, self.case.how
        roles = {"supervisor": self.rig.pid, **self.children}
        victims = list(roles.values()) if role == "all" else [roles[role]] if role in roles else []
        if self.rig.poll() is not None or not victims or not all(lives(victim) for victim in victims):
            raise Again
        self.hit_ns, self.bytes_at_hit = time.monotonic_ns(), self.recorded_bytes()
        try:
            for victim in victims:
                os.kill(victim, signal.SIGKILL if how == "KILL" else signal.SIGSTOP)
        except ProcessLookupError:
            raise Again from None
        if how == "KILL":
            return
        time.sleep(self.stop_s())
        with contextlib.suppress(ProcessLookupError):
            # The supervisor may have killed it.
            os.kill(victims[0], signal.SIGCONT)

    def stop_s(self):
        """Longest in lockstep: longer than the patience of all processes in turn."""
        if self.case.clock == "rt":
            longer_s = 2 * self.rigs.silent_cycles / 1000 + STOP_MARGIN_S
            return RECORDER_PAUSE_S if self.case.how == "PAUSE" else longer_s
        return PATIENCE_S * (self.chance.uniform(3, 4) if self.case.how == "STOP" else self.chance.uniform(0, 0.5))

    # What it left.

    def judge(self, moment):
        """Returns what became of the run."""
        clock, how, role, _ = self.case
        code, is_killed = self.rig.returncode, how == "KILL" and role in ("supervisor", "all")
        if is_killed:
            began_ns = time.monotonic_ns()
            clean(self.rigs.masseter, self.runtime)
            self.measures[CLEAN] = (time.monotonic_ns() - began_ns) / 1e6
        self.require_nothing_left()
        require(code == -signal.SIGKILL if is_killed else code in TYPED, f"exit code {code}")
        if clock == "rt" and (how != "STOP" and code == DISTURBED or self.is_faulty_before()):
            raise Again
        verified, verdict, summary = self.verify(), self.verdict(), self.summary()
        word, reason = verdict["word"], verdict["reason"]
        what = f"exit {code}, {word}, recording {verified}"
        passed = code == PASSED or word.startswith("PASS")
        if clock == "lockstep" and how == "KILL" and self.bytes_at_hit == len(self.rigs.recording):
            # The process had nothing left to do.
            moment = "end"
        if how == "KILL" and moment != "end" and clock != "virtual":
            # A supervisor that only writes the report may be killed. Under virtual time the bytes show whether it did.
            require(not passed, f"{what}: a run passed whose process was killed")
        if how == "KILL" and not is_killed:
            require(code == DIED or moment == "end" and passed, f"{what}: the death is not the run's end")
            require(not reason or reason.startswith(f"the {role} died: SIGKILL (9), "), f"{what}: {reason}")
        if clock == "lockstep" and how == "STOP" and self.case.moment == MOTION:
            require(code == DIED and reason.startswith(f"the {role} died: "), f"{what}: the silent {role} was not given up: {reason}")
        if how in ("PAUSE", "NONE") or (how == "STOP" and role == "supervisor"):
            require(passed and verified == "complete", f"{what}: the run did not go on: {reason}")
        if clock == "rt":
            self.judge_real_time(what, summary)
        else:
            if how == "STOP" and not passed:
                # Without a reason no process had reported ready.
                require(not reason or reason.startswith(f"the {role} died: "), f"{what}: {reason}")
            what += self.judge_bytes(what, passed, summary)
        return what

    def require_nothing_left(self):
        left = left_of(f"{self.rig.pid}-", self.runtime)
        require(not left, f"{left} stayed")

    def is_faulty_before(self):
        """Whether the machine had stopped the rig before the hit."""
        return self.case.how != "NONE" and any(fault["time_ns"] < self.hit_ns for fault in self.faults(self.summary()))

    def faults(self, summary):
        return [event for event in summary["figures"]["events"] if event["kind"] == "fault"] if summary else []

    def judge_real_time(self, what, summary):
        how, role = self.case.how, self.case.role
        if how == "STOP":
            # Of the cycles that it cost, the machine may be taken for the cause.
            is_stopped = self.rig.returncode in (SAFE_STOP, DISTURBED) and summary["figures"]["final_state"] == "safe_stop"
            require(is_stopped, f"{what}: no safe stop")
        if role in REACTION and not self.was_moving(summary):
            if self.case.moment == MOTION:
                # The machine had stopped the rig.
                raise Again
        elif role in REACTION:
            times_ns = [fault["time_ns"] for fault in self.faults(summary) if fault["cause"] == REACTION[role]]
            require(times_ns, f"{what}: nobody reported {REACTION[role]}")
            self.measures[REACTS] = (times_ns[0] - self.hit_ns) / 1e6
            require(self.measures[REACTS] < self.rigs.reaction_ms, f"{what}: reaction after {self.measures[REACTS]:.1f} ms")
        if how == "KILL" and role in ("controller", "recorder") and self.recorded_bytes() > BEGUN_BYTES:
            if role == "recorder" and any(topic["missing"] for topic in summary["figures"]["topics"]):
                # The recorder was starved before the hit, and counted that.
                raise Again
            self.judge_readings(what)

    def was_moving(self, summary):
        """Whether the sequence was in a state with moving drives, and did not leave these before the reaction."""
        events = summary["figures"]["events"] if summary else []
        entered = [event for event in events if event["source"] == "controller" and event["transition"]]
        before = [event["transition"][1] for event in entered if event["time_ns"] < self.hit_ns]
        after = [event["transition"][1] for event in entered if event["time_ns"] >= self.hit_ns]
        return bool(before) and before[-1] in MOVING and "disabling" not in after

    def judge_readings(self, what):
        """What a killed recorder's recording lacks at its end, and the drives at the end of a run without controller."""
        tables = self.run / "tables"
        self.call(PASSED, "export", self.readable(), "--format", "csv", "--table", "reading", "--out", tables)
        with (tables / "reading.csv").open() as table:
            *_, last = csv.DictReader(table)
        if self.case.role == "recorder":
            self.measures[LACKS] = max(0.0, (self.hit_ns - int(last["published_ns"])) / 1e6)
        else:
            states = {last[f"drive_state_{axis}"] for axis in range(6)}
            require(not states & WITH_FORCE, f"{what}: the drives end as {states}")

    def judge_bytes(self, what, passed, summary):
        """In simulated time every run has the bytes of virtual time, or their beginning."""
        found = self.recording.read_bytes() if self.recording.exists() else b""
        is_same = found == self.rigs.recording
        if passed:
            is_equal = is_same and summary["figures"]["digest"] == self.rigs.digest
            require(is_equal, f"{what}: a run passed with other bytes than virtual time")
        if self.case.how == "KILL" and self.case.role == "recorder":
            require(self.rigs.recording.startswith(found), f"{what}: not the beginning of the recording under virtual time")
        return ", bytes of virtual time" if is_same else ""

    def summary(self):
        path = self.run / "summary.json"
        return json.loads(path.read_text()) if path.exists() else None

    def verdict(self):
        """`masseter report` judges a run without a supervisor, if there is enough of it."""
        if summary := self.summary():
            return summary["verdict"]
        nothing = {"word": "nothing to judge", "reason": ""}
        if not self.run.exists():
            return nothing
        words = [self.rigs.masseter, "report", self.run]
        report = subprocess.run(words, env=inside(self.runtime), capture_output=True, text=True)
        require(report.returncode in TYPED, f"`masseter report` ended with {report.returncode}: {report.stderr}")
        summary = self.summary()
        # It knows no more than that the supervisor died.
        return {"word": f"{summary['verdict']['word']} by report", "reason": ""} if summary else nothing

    def call(self, code, *words):
        ended = subprocess.run([self.rigs.masseter, *words], capture_output=True, text=True)
        require(ended.returncode == code, f"{words[:2]} ended with {ended.returncode}: {ended.stdout}{ended.stderr}")

    def readable(self):
        recovered = self.run / "recovered.mcap"
        return recovered if recovered.exists() else self.recording

    def verify(self):
        """How complete a recording is; one that is not can be recovered."""
        if not self.recorded_bytes():
            return "not begun"
        words = [self.rigs.masseter, "recording", "verify", self.recording]
        verified = subprocess.run(words, capture_output=True, text=True)
        if verified.returncode == PASSED:
            return "complete"
        require(verified.returncode == INCOMPLETE, f"recording verify ended with {verified.returncode}: {verified.stdout}")
        recovered = self.run / "recovered.mcap"
        self.call(PASSED, "recording", "recover", self.recording, "--out", recovered)
        if self.recorded_bytes() > BEGUN_BYTES:
            self.call(PASSED, "recording", "verify", recovered)
        return "cut short"

    # Many short stops.

    def stall(self):
        deadline = time.monotonic() + START_S
        while self.rig.poll() is None and not {"controller", "plant"} <= children_of(self.rig).keys():
            require(time.monotonic() < deadline, "the rig has no processes")
            time.sleep(0.01)
        self.children = children_of(self.rig)
        victims, stalls = [self.children[role] for role in ("controller", "plant") if role in self.children], 0
        deadline = time.monotonic() + LONGEST_STALLED_S
        while self.rig.poll() is None and victims:
            require(time.monotonic() < deadline, "the stalled rig does not end")
            victim = self.chance.choice(victims)
            try:
                os.kill(victim, signal.SIGSTOP)
                time.sleep(self.chance.choice(STALLS_S))
                os.kill(victim, signal.SIGCONT)
            except ProcessLookupError:
                break
            stalls += 1
            time.sleep(self.chance.uniform(0.002, LONGEST_BREAK_S))
        self.wait()
        self.require_nothing_left()
        require(self.rig.returncode in TYPED, f"exit code {self.rig.returncode}")
        require(self.verify() == "complete", "the recording of a stalled rig is not complete")
        faults, word = self.faults(self.summary()), self.verdict()["word"]
        refused = [fault for fault in faults if fault["cause"] in REFUSALS]
        require(word == "INVALID" or not refused, f"no stall explains that the gate refused a command: {refused}")
        self.measures = {STALLS: stalls, REFUSED: len(refused)}
        return "whole run", f"{word}, {faults[0]['cause'] if faults else 'no fault'}"
