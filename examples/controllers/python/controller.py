#!@FOLDER@/.venv/bin/python
"""A pose controller: an integral of the position error is added to the desired pose."""

import math

import masseter

LIMIT_M = 1e-3  # the most that is added
GAIN = masseter.Parameter("gain", 5.0, (0.0, 100.0), "1/s", "Integral gain.")
TRIM = masseter.Signal("trim", "mm", "Length of the correction.")


class IntegralLaw:
    def __init__(self) -> None:
        self.trim_m = [0.0, 0.0, 0.0]

    def __call__(self, demand: masseter.Demand) -> masseter.Pose:
        if demand.estimated is not None:
            share = demand.parameters["gain"] * demand.period_s
            both = zip(demand.desired.position_m, demand.estimated.position_m)
            self.trim_m = [t + (want - have) * share for t, (want, have) in zip(self.trim_m, both)]
            x, y, z = self.trim_m
            length_m = math.sqrt(x * x + y * y + z * z)
            if length_m > LIMIT_M:
                self.trim_m = [t * (LIMIT_M / length_m) for t in self.trim_m]
            demand.signals["trim"] = 1e3 * length_m
        position_m = [p + t for p, t in zip(demand.ahead.position_m, self.trim_m)]
        return masseter.Pose(position_m, demand.ahead.quaternion_wxyz)


if __name__ == "__main__":
    masseter.control(IntegralLaw(), signals=[TRIM], parameters=[GAIN])
