"""What longer steps of the emulated mechanism change, for docs/dynamics.md: scripts/step_length.py MASSETER SCENARIO ...

Plays each scenario with steps of 10, 125 and 250 µs, and prints how far positions and bite force are from those of the shortest.
The encoders have no noise and fine increments, since their errors would hide the difference.
Needs mcap-ros2-support and NumPy.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages

STEPS_NS = [10_000, 125_000, 250_000]
ENCODERS = [
    f"drives.{drive}.{key}" for drive in ("slide", "leg") for key in ("encoder_noise_m=0", "encoder_resolution_m=1e-9")
]


def truths(masseter: str, scenario: str, step_ns: int, folder: Path) -> np.ndarray:
    """A row for each cycle: its number, six positions, m, and the bite force, N."""
    values = [f"dynamics.step_ns={step_ns}", *ENCODERS]
    options = ["--clock", "virtual", "--quiet", "--out", str(folder), *(f"--set={value}" for value in values)]
    subprocess.run([masseter, "run", scenario, *options], check=True, stdout=subprocess.DEVNULL)
    messages = (message.ros_msg for message in read_ros2_messages(str(folder / "recording.mcap"), topics=["truth"]))
    return np.array([[message.cycle, *message.joint_m, message.bite_force_n] for message in messages])


def main() -> None:
    masseter, *scenarios = sys.argv[1:]
    for scenario in scenarios:
        with tempfile.TemporaryDirectory() as work:
            shortest, *others = [truths(masseter, scenario, step_ns, Path(work, str(step_ns))) for step_ns in STEPS_NS]
        for step_ns, other in zip(STEPS_NS[1:], others):
            assert (other[:, 0] == shortest[:, 0]).all(), "other cycles"
            away = np.abs(other - shortest)
            metres, newtons = away[:, 1:7], away[:, 7]
            rms_um = 1e6 * np.sqrt((metres**2).mean())
            print(f"{scenario}, {step_ns / 1000:.0f} µs: positions rms {rms_um:.3f} µm, at most {1e6 * metres.max():.2f} µm; "
                  f"bite force at most {newtons.max():.3f} N")


main()
