"""What longer steps of the emulated mechanism change, for docs/dynamics.md: scripts/step_length.py MASSETER SCENARIO

Plays a scenario with steps of 10, 125 and 250 µs, and prints how far positions and bite force are from those of the shortest.
Needs mcap-ros2-support and NumPy.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages

STEPS_NS = [10_000, 125_000, 250_000]


def truths(masseter: str, scenario: str, step_ns: int, folder: Path) -> np.ndarray:
    """A row for each cycle: six positions, m, and the bite force, N."""
    options = ["--clock", "virtual", "--set", f"dynamics.step_ns={step_ns}", "--out", str(folder)]
    # Any verdict will do.
    subprocess.run([masseter, "run", scenario, *options], stdout=subprocess.DEVNULL)
    messages = read_ros2_messages(str(folder / "recording.mcap"), topics=["truth"])
    return np.array([[*message.ros_msg.joint_m, message.ros_msg.bite_force_n] for message in messages])


def main() -> None:
    masseter, scenario = sys.argv[1:]
    with tempfile.TemporaryDirectory() as work:
        shortest, *others = [truths(masseter, scenario, step_ns, Path(work, str(step_ns))) for step_ns in STEPS_NS]
    for step_ns, other in zip(STEPS_NS[1:], others):
        cycles = min(len(shortest), len(other))
        away = np.abs(other[:cycles] - shortest[:cycles])
        metres, newtons = away[:, :6], away[:, 6]
        rms_um = 1e6 * np.sqrt((metres**2).mean())
        print(f"{step_ns / 1000:.0f} µs: positions rms {rms_um:.2f} µm, at most {1e6 * metres.max():.1f} µm; "
              f"bite force at most {newtons.max():.2f} N")


main()
