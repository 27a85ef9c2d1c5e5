"""A linear-quadratic regulator as pose law. It corrects the position of the platform by what the drives leave over.

    masseter run examples/controllers/lqr.toml --controller "python3 examples/controllers/lqr.py"

Each coordinate is the same plant. A correction u goes out in cycle k, and the drives go towards it from the sample k + 1 on, as a
lag of first order: y[k+1] = y[k] + share (u[k-1] - y[k]). The error e is that of a slow disturbance less y. In differences from
cycle to cycle the disturbance falls out, so the regulator leaves no steady error:

    x = (e, dy, du of the cycle before),  e' = e - dy',  dy' = (1 - share) dy + share du,  cost = sum of e^2 + effort du^2
"""

import math

import numpy as np

import masseter

SERVO_PER_S = 100.0  # drives.*.position_gain_per_s
EFFORT = masseter.Parameter("effort", 10.0, (1e-3, 1e12), "", "Cost of a change of the correction, against the error's.")
TRIM = masseter.Signal("trim", "um", "Length of the correction.")


def regulator(share: float, effort: float) -> np.ndarray:
    """The gains of the states, by the Riccati equation."""
    plant = np.array([[1.0, share - 1.0, -share], [0.0, 1.0 - share, share], [0.0, 0.0, 0.0]])
    enters = np.array([[0.0], [0.0], [1.0]])
    error = np.diag([1.0, 0.0, 0.0])
    cost, gains = error, np.zeros((1, 3))
    for _ in range(10_000):
        gains = enters.T @ cost @ plant / (effort + enters.T @ cost @ enters)
        cost, before = error + plant.T @ cost @ (plant - enters @ gains), cost
        if np.allclose(cost, before, rtol=1e-12, atol=0.0):
            break
    return gains[0]


class Regulator:
    def __init__(self) -> None:
        self.share, self.gains = 0.0, np.zeros(3)
        #: Correction, its last change, and that of the drives, m.
        self.trim_m, self.asked_m, self.moved_m = np.zeros(3), np.zeros(3), np.zeros(3)

    def prepare(self, period_s: float, parameters: dict[str, float]) -> None:
        self.share = 1.0 - math.exp(-SERVO_PER_S * period_s)
        self.gains = regulator(self.share, parameters.get("effort", EFFORT.value))

    def __call__(self, demand: masseter.Demand) -> masseter.Pose:
        if demand.estimated is not None:
            error_m = np.subtract(demand.desired.position_m, demand.estimated.position_m)
            change_m = -self.gains @ np.array([error_m, self.moved_m, self.asked_m])
            self.moved_m = (1.0 - self.share) * self.moved_m + self.share * self.asked_m
            self.asked_m = change_m
            self.trim_m = self.trim_m + change_m
            demand.signals["trim"] = 1e6 * float(np.linalg.norm(self.trim_m))
        return masseter.Pose((demand.ahead.position_m + self.trim_m).tolist(), demand.ahead.quaternion_wxyz)


if __name__ == "__main__":
    law = Regulator()
    masseter.control(law, signals=[TRIM], parameters=[EFFORT], prepare=law.prepare)
