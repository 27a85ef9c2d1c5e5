"""The profile of a run without a recording in docs/realtime.md: python3 scripts/virtual_profile.py MASSETER

`perf` samples the default motion with its calls. A sample belongs to the part of the innermost function that has one.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PARTS = {
    "condition number": ["Conditioning::", "symmetric_eigen", "SymmetricEigen", "symmetric_tridiagonal"],
    "analysis": ["masseter_judge::"],
    "check of the motion": ["masseter_plan::", "trajectory::check"],
    "simulated wires": ["masseter_can::"],
    "drives": ["masseter_drives::"],
    "mechanism": ["masseter_plant::simulator::mechanism::", "masseter_model::dynamics::",
                  "masseter_model::geometry::", "Emulation::push", "Emulation::move_mechanism"],
    "controller": ["masseter_controller::", "masseter_runtime::control::"],
    "master, order of events": ["masseter_plant::"],
}


def stacks(masseter: str, folder: Path) -> Iterator[list[str]]:
    """The calls of each sample, from the inside out."""
    (folder / "one.toml").write_text('name = "one"\n')
    perf = ["perf", "record", "-q", "-F", "4999", "--call-graph", "dwarf,4096", "-o", "perf.data"]
    run = [str(Path(masseter).resolve()), "test", "one.toml"]
    subprocess.run([*perf, *run], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    script = ["perf", "script", "-i", "perf.data", "-F", "ip,sym"]
    text = subprocess.run(script, cwd=folder, check=True, capture_output=True, text=True).stdout
    for sample in text.strip().split("\n\n"):
        yield sample.splitlines()


def part_of(calls: list[str]) -> str:
    is_of_controller = any("masseter_controller::" in call for call in calls)
    for call in calls:
        for part, names in PARTS.items():
            if any(name in call for name in names):
                # The controller has kinematics of its own.
                return "controller" if part == "mechanism" and is_of_controller else part
    return "start, messages, kernel"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        parts = Counter(part_of(calls) for calls in stacks(sys.argv[1], Path(folder)))
    for part, samples in parts.most_common():
        print(f"{100 * samples / parts.total():5.1f} % {part}")


main()
