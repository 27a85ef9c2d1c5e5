"""What a step of masseter.Env costs beside a cycle of a virtual run: python tests/python/env_rates.py"""

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import masseter

CYCLES = 10_000
ROUNDS = 3
# The jaw stays, and no limit of the distance from the motion stops it.
MOTION = {
    "duration_s": 20.0,
    "controller.tracking_limit_m": 0.1,
    "controller.tracking_limit_rad": 1.0,
    "controller.tracking_rms_limit_m": 0.1,
    "controller.tracking_rms_limit_rad": 1.0,
}


def least(measure: Callable[[], float]) -> float:
    return min(measure() for _ in range(ROUNDS))


def run_s(seconds: int) -> float:
    """A virtual run of the command, as a user starts it."""
    command = os.environ.get("MASSETER", "masseter")
    with tempfile.TemporaryDirectory() as folder:
        arguments = ["run", "--clock", "virtual", "--quiet", "--duration", str(seconds), "--out", str(Path(folder) / "run")]
        begun = time.perf_counter()
        subprocess.run([command, *arguments], check=True, capture_output=True)
        return time.perf_counter() - begun


def steps_s(env: masseter.Env) -> float:
    """So many steps in which the jaw stays."""
    stay = env.reset(seed=1)[0][:6] * 1e-3
    begun = time.perf_counter()
    for _ in range(CYCLES):
        env.step(stay)
    return time.perf_counter() - begun


def vector_s(environments: int, cycles: int) -> float:
    """Seconds for an environment and cycle."""
    vector = masseter.VectorEnv(environments, set=MOTION, cycles_per_step=cycles)
    stay = vector.reset(seed=1)[0][:, :6] * 1e-3
    begun = time.perf_counter()
    for _ in range(CYCLES // cycles):
        vector.step(stay)
    return (time.perf_counter() - begun) / environments / CYCLES


# The difference of two lengths leaves out the start and the report.
cycle_s = (least(lambda: run_s(20)) - least(lambda: run_s(10))) / 10_000
step_s = least(lambda: steps_s(masseter.Env(set=MOTION))) / CYCLES
print(f"a cycle of a virtual run:     {cycle_s * 1e6:.1f} µs")
print(f"a step of masseter.Env:       {step_s * 1e6:.1f} µs, {step_s / cycle_s:.2f} cycles of a run; {1 / step_s:.0f} steps a second")
env = masseter.Env(set=MOTION)
env.reset(seed=1)
begun = time.perf_counter()
env.reset(seed=2)
print(f"a reset with another seed:    {(time.perf_counter() - begun) * 1e3:.1f} ms")
begun = time.perf_counter()
env.reset(seed=2)
print(f"a reset with the same seed:   {(time.perf_counter() - begun) * 1e3:.2f} ms")
one_s, eight_s = least(lambda: vector_s(1, 50)), least(lambda: vector_s(8, 50))
print(f"eight environments beside one: {one_s / eight_s:.2f} times as many cycles a second, 50 cycles a step")
