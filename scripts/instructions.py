"""Judges the instructions of a cycle: scripts/instructions, which builds what is counted here.

Callgrind counts each work twice, with different numbers of repetitions. The difference is free of start and preparation, and
does not depend on what else the machine does.
"""

import json
import os
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

FIGURES = Path("tests/instructions.json")
TOLERANCE = 0.02
PARTS = ["forward kinematics", "inverse kinematics", "plant step", "controller cycle"]
# Cycles of the motion at 1 kHz, and calls of a part. The program of the parts prepares 500 calls.
REPETITIONS = 250

# glibc then takes the same functions on every processor; those for AVX save 2 % of a cycle.
BASELINE = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-ERMS"}


def instructions(command: list[str]) -> int:
    """Instructions of a program, from its start to its end."""
    callgrind = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", *command]
    ended = subprocess.run(callgrind, env=os.environ | BASELINE, capture_output=True, text=True)
    collected = re.search(r"Collected : (\d+)", ended.stderr)
    if ended.returncode or not collected:
        sys.exit(f"{' '.join(callgrind)} ended with {ended.returncode}:\n{ended.stdout}{ended.stderr}")
    return int(collected[1])


def count(masseter: str, parts: str) -> dict[str, int]:
    """Instructions of each work, for one repetition."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(os.cpu_count()) as pool:

        def run(repetitions: int) -> list[str]:
            scenario = Path(folder, f"{repetitions}.toml")
            scenario.write_text(f'name = "chewing"\nduration_s = {repetitions * 1e-3}\n')
            return [masseter, "test", str(scenario), "--out", f"{folder}/runs-{repetitions}"]

        def of_part(part: str) -> Callable[[int], list[str]]:
            return lambda repetitions: [parts, part, str(repetitions)]

        works = {"cycle of a run": run} | {part: of_part(part) for part in PARTS}
        commands = [work(REPETITIONS * times) for work in works.values() for times in (1, 2)]
        counts = list(pool.map(instructions, commands))
        differences = zip(works, counts[::2], counts[1::2])
        return {name: round((twice - once) / REPETITIONS) for name, once, twice in differences}


def toolchain() -> str:
    """What the figures depend on, besides the code."""
    rustc = subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout.strip()
    return f"{rustc}, {platform.machine()}, {' '.join(platform.libc_ver())}"


def main() -> None:
    masseter, parts, *options = sys.argv[1:]
    if options not in ([], ["--renew"]):
        sys.exit("usage: scripts/instructions [--renew]")
    counted = {"toolchain": toolchain(), "instructions": count(masseter, parts)}
    known = json.loads(FIGURES.read_text())
    if options:
        FIGURES.write_text(json.dumps(counted, indent=2) + "\n")

    changed = []
    print(f"{'instructions of one':22}{'figure':>10}{'counted':>10}")
    for name, now in counted["instructions"].items():
        figure = known["instructions"].get(name, 0)
        change = now / figure - 1 if figure else float("inf")
        print(f"{name:22}{figure:10}{now:10}{change:+9.2%}")
        if abs(change) > TOLERANCE:
            changed.append(f"{name} {change:+.1%}")
    if options:
        print(f"{FIGURES} is renewed; its commit says why the figures change")
    elif counted["toolchain"] != known["toolchain"]:
        print(f"not judged (the figures are of {known['toolchain']}; this is {counted['toolchain']})")
    elif changed:
        sys.exit(f"instructions: {', '.join(changed)}; at most {TOLERANCE:.0%} are allowed. Make the work cheaper again, or "
                 "run scripts/instructions --renew and say why in its commit; also after a gain, or it could be lost unseen")
    else:
        print(f"every figure is within {TOLERANCE:.0%}")


main()
