"""Poses a second of fk and ik: python tests/python/rates.py"""

import time
from collections.abc import Callable

import numpy as np

import masseter

ROWS = 200_000
ROUNDS = 3


def best_rate(work: Callable[[], object]) -> float:
    """Rows a second of the fastest round."""

    def seconds() -> float:
        begun = time.perf_counter()
        work()
        return time.perf_counter() - begun

    return ROWS / min(seconds() for _ in range(ROUNDS))


time_s = np.linspace(0.0, ROWS / 1000, ROWS)[:, None]
motion = np.array([0, 0, 0, 0.27, 0.27, 0.27]) + 0.005 * np.sin(time_s * np.arange(1, 7))
random = np.random.default_rng(1)
scattered = np.array([0, 0, 0, 0.27, 0.27, 0.27]) + random.uniform(-0.005, 0.005, (ROWS, 6))
position_m, quaternion_wxyz = masseter.fk(motion)
print(f"fk along a motion:  {best_rate(lambda: masseter.fk(motion)) / 1e6:.2f} million poses a second")
print(f"fk of random rows:  {best_rate(lambda: masseter.fk(scattered)) / 1e6:.2f} million poses a second")
print(f"ik:                 {best_rate(lambda: masseter.ik(position_m, quaternion_wxyz)) / 1e6:.2f} million poses a second")
