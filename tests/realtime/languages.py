"""What a pose law costs in each language: in real time from the wake-up to the command, in lockstep of each cycle. The projects of
`masseter new controller`, and the FMUs of tests/python/fmus.py, beside the rig's own controller; all in turn, several rounds.

    python tests/realtime/languages.py MASSETER TARGET ROUNDS

TARGET: the build folder of Masseter's source, whose built crates Rust, C and C++ use. This Python plays the law in Python.
"""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import masseter

TESTS = Path(__file__).parents[1]
sys.path += [str(TESTS / "foreign"), str(TESTS / "python")]
import fmus  # noqa: E402
from projects import make, shell  # noqa: E402

MOTION_S = 5
OWN = "the rig's own"
#: Of the law that the FMUs are made of.
MAP = """
[inputs]
desired_z = { value = "desired.z", unit = "m" }
estimated_z = { value = "estimated.z", unit = "m" }
ahead_z = { value = "ahead.z", unit = "m" }

[outputs]
z = { value = "pose.z", unit = "m" }
error = "signal.error"

[start]
gain = 0.2
"""


def build(command: str, target: Path, folder: Path) -> dict[str, str]:
    """The controllers to play, by the names in the table."""
    languages = {"C": "c", "C++": "cpp", "Rust": "rust"}
    found = {OWN: "motion"} | {name: make(command, language, "pose", folder, target) for name, language in languages.items()}
    shell(f"{command} new controller --lang python python", folder)
    found["Python"] = f"{sys.executable} {folder / 'python' / 'controller.py'}"
    for name, fmu in {"FMU in C": fmus.in_c(folder, 3), "FMU of pythonfmu3": fmus.by_generator(folder, 3)}.items():
        fmu.with_suffix(".toml").write_text(MAP)
        found[name] = f"fmu:{fmu}"
    return found


def run(command: str, program: str, clock: str, folder: Path) -> tuple[masseter.Run, float]:
    """The run, and its duration, s."""
    begun = time.perf_counter()
    arguments = ["--duration", str(MOTION_S), "--clock", clock, "--controller", program, "--out", str(folder)]
    # An FMU is played by the python3 of the PATH.
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    ended = subprocess.run([command, "run", "--quiet", *arguments], capture_output=True, text=True, env=environment)
    duration_s = time.perf_counter() - begun
    run = masseter.load(folder)
    # A slow law fails the timing of a run in real time, and is measured all the same.
    assert len(run.command) > 1000, ended.stdout + ended.stderr
    return run, duration_s


def work_us(run: masseter.Run) -> np.ndarray:
    """From the wake-up to the command of each cycle while the motion plays, µs."""
    played = run.state[run.state["controller_state"] == masseter.messages.ControllerState.RUNNING]
    return (played["commanded_ns"].astype(np.int64) - played["woke_ns"].astype(np.int64)) / 1e3


def main(command: str, target: str, rounds: str) -> None:
    command = str(Path(command).resolve())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        programs = build(command, Path(target).resolve(), folder)
        times: dict[str, list[np.ndarray]] = {name: [] for name in programs}
        skipped = dict.fromkeys(programs, 0)
        cycle_us: dict[str, list[float]] = {name: [] for name in programs}
        for number in range(int(rounds)):
            for place, (name, program) in enumerate(programs.items()):
                in_real_time, _ = run(command, program, "rt", folder / f"{number}-{place}-rt")
                times[name].append(work_us(in_real_time))
                skipped[name] += int(in_real_time.state["skipped_cycles"][-1])
                simulated, duration_s = run(command, program, "lockstep", folder / f"{number}-{place}-lockstep")
                cycle_us[name].append(duration_s / len(simulated.state) * 1e6)
    medians = {name: np.array([np.median(one) for one in found]) for name, found in times.items()}
    print("| controller | wake-up to command, p50, µs | against the rig's own | p99, µs | skipped cycles | lockstep, µs a cycle, with start and end |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, p50 in medians.items():
        ratio = np.median(p50 / medians[OWN])
        p99 = np.percentile(np.concatenate(times[name]), 99)
        spread = f"{np.median(p50):.1f} ({p50.min():.1f}–{p50.max():.1f})"
        print(f"| {name} | {spread} | {ratio:.2f} × | {p99:.0f} | {skipped[name]} | {min(cycle_us[name]):.0f} |")


main(*sys.argv[1:])
