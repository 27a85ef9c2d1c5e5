"""An impedance as pose law: the jaw gives way to a force like a mass on a spring with a damper.

    masseter run examples/controllers/impedance.toml --controller "python3 examples/controllers/impedance.py"

The drives control positions. So the law turns the estimated external force f into a way u, which it adds to the desired position:

    M dv/dt + D v + K u = f,  v = du/dt

A larger K bites harder. The way is a motion of the law's own, so the rig judges what the scenario requires of the true jaw. The mass delays, and the drives and the estimate too: a damping that is small beside the stiffness of the food
lets the jaw shake (docs/dynamics-control.md, limit of stability).
"""

import numpy as np

import masseter

STIFFNESS = masseter.Parameter("stiffness", 2.0, (0.0, 1000.0), "N/mm", "K: force for a way.")
DAMPING = masseter.Parameter("damping", 100.0, (1.0, 100_000.0), "N s/m", "D: force for a speed.")
MASS_TIME_S = 0.003  # M = D times this
REACH_M = 0.02  # the most that the jaw gives way
WAY = masseter.Signal("way", "mm", "How far the jaw gives way.")
FORCE = masseter.Signal("felt", "N", "Estimated external force.")


class Impedance:
    def __init__(self) -> None:
        self.way_m, self.speed_m_s = np.zeros(3), np.zeros(3)

    def __call__(self, demand: masseter.Demand) -> masseter.Pose:
        if demand.external is not None:
            force_n = np.array(demand.external.force_n)
            stiffness_n_per_m, damping = 1e3 * demand.parameters["stiffness"], demand.parameters["damping"]
            mass_kg = damping * MASS_TIME_S
            # The new speed, which damping and spring already answer: stable for any stiffness.
            period_s = demand.period_s
            resistance = mass_kg / period_s + damping + stiffness_n_per_m * period_s
            push_n = force_n - stiffness_n_per_m * self.way_m + mass_kg / period_s * self.speed_m_s
            self.speed_m_s = push_n / resistance
            self.way_m = np.clip(self.way_m + period_s * self.speed_m_s, -REACH_M, REACH_M)
            demand.signals["felt"] = float(np.linalg.norm(force_n))
        demand.signals["way"] = 1e3 * float(np.linalg.norm(self.way_m))
        return masseter.Pose((demand.ahead.position_m + self.way_m).tolist(), demand.ahead.quaternion_wxyz)


if __name__ == "__main__":
    masseter.control(Impedance(), signals=[WAY, FORCE], parameters=[STIFFNESS, DAMPING], own_motion=True)
