"""The transport of a command and a reading to a controller in each language, at 1 kHz: the rig's own, and one session in C++ and
one in Python, each blocking and polling, in turn.

    python tests/realtime/round_trip.py MASSETER TARGET ROUNDS

TARGET holds release/libmasseter_c.so. Exit code 1 if C++ takes more than 1.5 times the transport of the rig's own controller.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import masseter

HERE = Path(__file__).parent
MOTION_S = 5
#: C++ against the rig's own controller.
MOST = 1.5


def build(folder: Path, target: Path) -> Path:
    program = folder / "session"
    library = target / "release" / "libmasseter_c.so"
    include = HERE.parents[1] / "rig" / "bindings" / "interface"
    command = ["g++", "-O2", "-std=c++17", f"-I{include}", str(HERE / "session.cpp"), str(library)]
    subprocess.run([*command, f"-Wl,-rpath,{library.parent}", "-o", str(program)], check=True)
    return program


def script(folder: Path, name: str, command: str) -> str:
    path = folder / name
    path.write_text(f"#!/bin/sh\nexec {command}\n")
    path.chmod(0o755)
    return str(path)


def round_trip_us(command: str, program: str, folder: Path) -> float:
    """Median of the time of a reading to the controller and of the controller's command to the plant, µs."""
    arguments = ["--duration", str(MOTION_S), "--clock", "rt", "--controller", program, "--out", str(folder)]
    ended = subprocess.run([command, "run", "--quiet", *arguments], capture_output=True, text=True)
    run = masseter.load(folder)
    assert len(run.command) > 1000, ended.stdout + ended.stderr
    # The reading lies there when the controller wakes: what counts is the time to take it.
    to_controller = run.state["received_ns"].astype(np.int64) - run.state["woke_ns"].astype(np.int64)
    sent = {int(cycle): int(at) for cycle, at in zip(run.command["cycle"], run.command["published_ns"], strict=True)}
    answered = run.reading[np.isin(run.reading["answers_cycle"], run.command["cycle"])]
    to_plant = [int(row["command_received_ns"]) - sent[int(row["answers_cycle"])] for row in answered]
    return float(np.median(to_controller) + np.median(to_plant)) / 1e3


def main(command: str, target: str, rounds: str) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program = build(folder, Path(target))
        python = f"{sys.executable} {HERE / 'session.py'}"
        programs = {
            "the rig's own": "motion",
            "C++, blocking": script(folder, "cpp-blocking", f"{program} blocking"),
            "C++, polling": script(folder, "cpp-polling", f"{program} polling"),
            "Python, blocking": script(folder, "python-blocking", f"{python} blocking"),
            "Python, polling": script(folder, "python-polling", f"{python} polling"),
        }
        times: dict[str, list[float]] = {one: [] for one in programs}
        for number in range(int(rounds)):
            for one, path in programs.items():
                times[one].append(round_trip_us(command, path, folder / f"run-{number}-{len(one)}-{Path(path).name}"))
    own = times["the rig's own"]
    print("| controller | taking a reading and handing over a command, p50, µs | against the rig's own |")
    print("| --- | ---: | ---: |")
    for one, found in times.items():
        ratio = np.median(np.array(found) / np.array(own))
        print(f"| {one} | {np.median(found):.2f} ({min(found):.2f}–{max(found):.2f}) | {ratio:.2f} × |")
    ratios = [np.median(np.array(times[f"C++, {way}"]) / np.array(own)) for way in ("blocking", "polling")]
    sys.exit(int(max(ratios) > MOST))


main(*sys.argv[1:])
