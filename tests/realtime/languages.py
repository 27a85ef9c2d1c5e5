"""What a pose law costs in each language: in real time from the wake-up to the command, in lockstep of each cycle. All languages
in turn, several rounds, beside the rig's own controller.

    python tests/realtime/languages.py MASSETER ROUNDS LANGUAGE=PROGRAM...
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import masseter

MOTION_S = 5


def run(command: str, program: str, clock: str, folder: Path) -> tuple[masseter.Run, float]:
    """The run, and its duration, s."""
    begun = time.perf_counter()
    arguments = ["--duration", str(MOTION_S), "--clock", clock, "--controller", program, "--out", str(folder)]
    ended = subprocess.run([command, "run", "--quiet", *arguments], capture_output=True, text=True)
    duration_s = time.perf_counter() - begun
    assert ended.returncode in (0, 3), ended.stdout + ended.stderr
    return masseter.load(folder), duration_s


def work_us(run: masseter.Run) -> np.ndarray:
    """From the wake-up to the command of each cycle while the motion plays, µs."""
    played = run.state[run.state["controller_state"] == masseter.messages.ControllerState.RUNNING]
    return (played["commanded_ns"].astype(np.int64) - played["woke_ns"].astype(np.int64)) / 1e3


def main(command: str, rounds: str, *programs: str) -> None:
    languages = {"the rig's own": "motion"} | dict(program.split("=", 1) for program in programs)
    times: dict[str, list[np.ndarray]] = {name: [] for name in languages}
    skipped = dict.fromkeys(languages, 0)
    cycle_us: dict[str, list[float]] = {name: [] for name in languages}
    with tempfile.TemporaryDirectory() as folder:
        for number in range(int(rounds)):
            for name, program in languages.items():
                place = Path(folder) / f"{name}-{number}"
                in_real_time, _ = run(command, program, "rt", place.with_suffix(".rt"))
                times[name].append(work_us(in_real_time))
                skipped[name] += int(in_real_time.state["skipped_cycles"][-1])
                simulated, duration_s = run(command, program, "lockstep", place.with_suffix(".lockstep"))
                cycle_us[name].append(duration_s / len(simulated.state) * 1e6)
    print("| controller | wake-up to command, p50, µs | p99, µs | skipped cycles | lockstep, µs a cycle, with start and end |")
    print("| --- | --- | --- | --- | --- |")
    for name in languages:
        p50, p99 = np.percentile(np.concatenate(times[name]), [50, 99])
        print(f"| {name} | {p50:.1f} | {p99:.1f} | {skipped[name]} | {min(cycle_us[name]):.0f} |")


main(*sys.argv[1:])
