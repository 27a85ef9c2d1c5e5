#!/usr/bin/env python3
"""Rigs of which one process is killed or stopped at a random moment: every case of a table, again and again.

    tests/realtime/disturbed.py target/release/masseter --times 200
    tests/realtime/disturbed.py target/release/masseter --times 50 --only 'lockstep STOP' --seed 12

Whatever is hit, all processes of the rig end in time with a typed exit code. Nothing stays in shared memory or in the
runtime folder. The recording is complete or can be recovered.

KILL: no run passes whose process was killed before its end. The verdict names the process; a killed supervisor's run is
judged by `masseter report`. In real time the survivor reacts within the bound, without the controller the drives lose their
force, and a recording lacks at most its last second. `masseter clean` soon makes room after the death of all processes.

PAUSE: a stop has no effect if it is shorter than the silence after which a process counts as dead; of the recorder, if it is
shorter than half of what its queues hold.

STOP: after a longer one the survivor stops the rig in real time. In lockstep the silent process is killed and named.

STALLS: controller and plant are stopped for 1 to 8 ms throughout a run. Other stops of so disturbed a rig are only counted,
but the last gate refuses at most one command in 500 stalls, and none that no stall explains.

In simulated time a run that passes has the bytes and the digest of virtual time, and what a killed recorder leaves is their
beginning. Those rigs run side by side, which keeps the machine busy. NONE: so they do when nothing is hit.

Prints the seed, what became of the rigs, and times as distributions. Fails after the last trial if anything was wrong.
Only the Python standard library is used.
"""

import argparse
import collections
import itertools
import random
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rig import Again, Wrong
from trial import ANY, CLEAN, LACKS, MOTION, REFUSED, ROLES, STALLS, Case, Rigs, Trial

CASES = [
    *(Case("rt", "KILL", role, ANY) for role in ROLES),
    *(Case("rt", "KILL", role, MOTION) for role in ("controller", "plant", "all")),
    *(Case("rt", "STOP", role, MOTION) for role in ("controller", "plant")),
    Case("rt", "PAUSE", "recorder", ANY),
    Case("rt", "STALLS", "loops", MOTION),
    *(Case("lockstep", how, role, ANY) for how in ("KILL", "PAUSE", "STOP") for role in ROLES),
    *(Case("lockstep", "STOP", role, MOTION) for role in ("controller", "plant")),
    Case("lockstep", "NONE", "none", ANY),
    Case("virtual", "KILL", "supervisor", ANY),
]
# Rigs in simulated time that run at once.
SIDE_BY_SIDE = 4
# Of one trial, on a machine that ends rigs by itself.
TRIES = 20
# `masseter clean`, the start of its process included. The aim is 50 ms, which a busy machine stretches.
BOUNDS_MS = {LACKS: 1000.0, CLEAN: 1000.0}
# A rig that ends after few stalls shows nothing.
LEAST_STALLS, STALLS_PER_REFUSAL = 50, 500


def play(rigs, seed, number, case):
    """Plays one trial, again where it shows nothing: its outcome, its measures, how often it showed nothing, and what is wrong."""
    for attempt in range(TRIES):
        with Trial(rigs, case, number, random.Random(f"{seed} {case} {number} {attempt}")) as trial:
            try:
                return trial.play(), trial.measures, attempt, None
            except Again:
                continue
            except Wrong as wrong:
                return None, {}, attempt, f"{trial.name}, attempt {attempt}: {wrong}"
    return None, {}, TRIES, f"{trial.name}: the machine is too disturbed, or the process is never there"


class Results:
    """What became of the trials."""

    def __init__(self):
        self.counts, self.again, self.wrong = collections.Counter(), collections.Counter(), []
        self.measures = collections.defaultdict(list)

    def take(self, case, played):
        outcome, measures, again, wrong = played
        self.counts[case, outcome] += 1
        self.again[case] += again
        self.wrong += [wrong] if wrong else []
        for measure, value in measures.items():
            self.measures[case, measure].append(value)

    def print(self):
        for (case, outcome), count in sorted(self.counts.items(), key=str):
            moment, what = outcome or (case.moment, "WRONG")
            print(f"{case.clock:<8} {case.how:<6} {case.role:<10} in {moment:<9} {count:>4} × {what}")
        for (case, measure), values in sorted(self.measures.items()):
            if measure in (STALLS, REFUSED) or case.clock != "rt":
                continue
            values.sort()
            p50, p99 = (values[min(len(values) - 1, int(share * len(values)))] for share in (0.5, 0.99))
            spread = f"p50 {p50:8.2f}  p99 {p99:8.2f}  max {values[-1]:8.2f} ms"
            print(f"{case.how:<6} {case.role:<10} {case.moment:<10} × {len(values):<4} {measure:<18} {spread}")
            if values[-1] > BOUNDS_MS.get(measure, values[-1]):
                self.wrong.append(f"{case.how} {case.role}: {measure} {values[-1]:.1f} ms, bound {BOUNDS_MS[measure]:.1f} ms")
        print(f"trials made again, as they showed nothing: {self.again.total()}")
        self.judge_stalls()

    def judge_stalls(self):
        of = lambda wanted: sum((values for (_, measure), values in self.measures.items() if measure == wanted), [])
        stalls, refused = of(STALLS), sum(of(REFUSED))
        if stalls:
            print(f"{sum(stalls)} stalls in {len(stalls)} runs, {refused} refused commands")
        if sum(stalls) < LEAST_STALLS * len(stalls):
            self.wrong.append("the stalled rigs ended too early to show anything")
        if refused > max(1, sum(stalls) // STALLS_PER_REFUSAL):
            self.wrong.append(f"the gate refused {refused} commands of the rig")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--times", type=int, default=20, help="hits of each case")
    parser.add_argument("--only", default="", help="cases that contain these words, such as 'rt KILL plant'")
    parser.add_argument("--silent-cycles", type=int, default=20, help="after which a partner counts as dead in real time")
    parser.add_argument("--seed", type=int, default=None, help="of an earlier call")
    arguments = parser.parse_args()
    seed = random.randrange(10**6) if arguments.seed is None else arguments.seed
    print(f"seed {seed}", flush=True)
    rigs, results = Rigs(arguments.masseter.resolve(), arguments.silent_cycles), Results()
    wanted = [case for case in CASES if arguments.only in " ".join(case)]
    for is_real, workers in ((True, 1), (False, SIDE_BY_SIDE)):
        cases = [case for case in wanted if (case.clock == "rt") == is_real]
        trials = list(itertools.product(range(arguments.times), cases))
        with ThreadPoolExecutor(workers) as pool:
            for (_, case), played in zip(trials, pool.map(lambda trial: play(rigs, seed, *trial), trials)):
                results.take(case, played)
    results.print()
    if results.wrong:
        sys.exit("\n".join(results.wrong))


if __name__ == "__main__":
    main()
