"""The tables of docs/dynamics-control.md: python3 scripts/control_tables.py MASSETER"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

MASSES = {"carriage_mass_kg": 0.7, "cylinder_mass_kg": 0.5, "rod_mass_kg": 0.4, "platform_mass_kg": 0.5}
FRICTION = {"slide_friction_n": 5.0, "viscous_friction_n_s_per_m": 20.0}

OFFSETS = """
duration_s = 6.0
[can]
buses = [[0, 1], [2, 3], [4, 5]]
[[drive_profile]]
pdos = { rpdo1 = ["6040h", "607Ah", "60B2h"] }
"""

ESTIMATE = """
duration_s = 6.0
[food]
[force_estimate]
"""

HOLD = """
duration_s = 8.0
[motion]
kind = "chewing"
cycle_rate_hz = 0.7
[motion.phases]
opening = 0.3
closing = 0.3
occlusion = 0.4
[can]
following_limit_m = 5e-4
[controller]
tracking_limit_m = 1e-3
tracking_limit_rad = 0.01
tracking_rms_limit_m = 5e-4
tracking_rms_limit_rad = 5e-3
[force_control]
profile = "hold"
bite_s = 0.6
"""

SOFT = HOLD + "[food]\n"
TEETH = HOLD + "[teeth]\nclearance_m = -2e-5\n"


def found(name: str, **keys: object) -> str:
    """A requirement that only reports a value."""
    lines = {"name": name, "max": "1000 N", **keys}
    return "[[require]]\n" + "".join(f"{key} = {toml(value)}\n" for key, value in lines.items())


def toml(value: object) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(inner)}" for key, inner in value.items()) + " }"
    return json.dumps(value)


def error(name: str, expression: str, during: object, statistic: str, percentile: int | None = None) -> str:
    keys = {} if percentile is None else {"percentile": percentile}
    return found(name, expression=expression, unit="N", during=during, statistic=statistic, **keys)


def run(masseter: str, scenario: str, settings: dict[str, object]) -> dict:
    """The summary of a run."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "scenario.toml")
        path.write_text(scenario)
        sets = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        command = [masseter, "run", path, "--clock", "virtual", "--out", Path(folder, "run"), *sets]
        subprocess.run(command, capture_output=True, check=False)
        return json.loads(Path(folder, "run/summary.json").read_text())


def values(summary: dict) -> list[float]:
    """What the requirements have found."""
    return [float(one["finding"].split()[0]) for one in summary["figures"]["requirements"]]


def scaled(quantities: dict[str, float], share: float) -> dict[str, object]:
    return {f"controller.model.{key}": value * share for key, value in quantities.items()}


def table(head: list[str], rows: Iterable[list[str]]) -> None:
    print("| " + " | ".join(head) + " |\n| --- |" + " ---: |" * (len(head) - 1))
    for row in rows:
        print("| " + " | ".join(row) + " |")
    print()


def feed_forward(masseter: str) -> Iterable[list[str]]:
    cases = {
        "none": {},
        "masses right": {"controller.feed_forward_torque": "true"},
        "masses 20 % too small": {"controller.feed_forward_torque": "true", **scaled(MASSES, 0.8)},
        "masses 20 % too large": {"controller.feed_forward_torque": "true", **scaled(MASSES, 1.2)},
        "friction 30 % too small": {"controller.feed_forward_torque": "true", **scaled(FRICTION, 0.7)},
    }
    for name, settings in cases.items():
        cells = []
        for rate_hz in (1.43, 2.17):
            summary = run(masseter, OFFSETS, {"motion.cycle_rate_hz": rate_hz, **settings})
            tracking = summary["figures"]["tracking"]
            cells += [f"{1e3 * tracking[key]:.1f}" for key in ("incisal_rms_mm", "incisal_max_mm")]
        yield [name, *cells]


def estimate(masseter: str) -> Iterable[list[str]]:
    difference = "{signal.bite_force_n} - {bite.force}"
    scenario = ESTIMATE + "".join(
        [
            error("rms", difference, "running", "rms"),
            error("p99", f"abs({difference})", "running", "percentile", 99),
            error("largest", f"abs({difference})", "running", "value"),
            found("uncertainty", signal="signal.bite_force_uncertainty_n", during="running", statistic="mean"),
        ]
    )
    cases = {
        "right": {},
        "friction 30 % too small": scaled(FRICTION, 0.7),
        "friction 30 % too large": scaled(FRICTION, 1.3),
        "masses 20 % too small": scaled(MASSES, 0.8),
        "masses 20 % too large": scaled(MASSES, 1.2),
    }
    for name, settings in cases.items():
        yield [name, *(f"{value:.1f}" for value in values(run(masseter, scenario, settings)))]


FORCES = "".join(
    [
        found("peak", signal="bite.force", during="signal.force_phase > 0.5"),
        # The second bite has settled.
        error("steady", "{bite.force} - {signal.desired_bite_force_n}", {"from_s": 2.8, "to_s": 2.88}, "rms"),
    ]
)


def bites(masseter: str, scenario: str, peak_n: float, settings: dict[str, object]) -> list[str]:
    """Overshoot, and rms error of the hold."""
    summary = run(masseter, scenario + FORCES, {"force_control.peak_n": peak_n, **settings})
    if summary["figures"]["final_state"] != "finished":
        return ["", "safe stop"]
    peak, steady = values(summary)
    return [f"{100 * (peak / peak_n - 1):.0f} %", f"{100 * steady / peak_n:.1f} %"]


def force_control(masseter: str) -> Iterable[list[str]]:
    for name, scenario, peak_n in (("soft food, 3.5 N/mm", SOFT, 25), ("14 teeth that meet", TEETH, 60)):
        yield [name, str(peak_n), *bites(masseter, scenario, peak_n, {})]


def load_cell(masseter: str) -> Iterable[list[str]]:
    """Estimate and load cell, with friction in the model that is right and wrong."""
    error_n, held = "{bite.force} - {signal.desired_bite_force_n}", {"from_s": 2.8, "to_s": 2.88}
    scenario = HOLD + "peak_n = 25\n[food]\n[load_cell]\n" + error("mean", error_n, held, "mean") + error("rms", error_n, held, "rms")
    for source in ("estimate", "load_cell"):
        for name, share in (("right", 1.0), ("30 % too small", 0.7), ("30 % too large", 1.3)):
            summary = run(masseter, scenario, {"force_control.source": source, **scaled(FRICTION, share)})
            yield [source, name, *(f"{value:.2f} N" for value in values(summary))]


def limit(masseter: str) -> Iterable[list[str]]:
    """Dampings on both sides of the limit. The stated stiffness is small, so that none is refused."""
    soft = {"force_control.food_stiffness_n_per_m": 10}
    for damping in (5, 10, 18, 36, 100):
        yield ["soft food", str(damping), *bites(masseter, SOFT, 25, {"force_control.damping_n_s_per_m": damping, **soft})]
    for damping in (500, 764, 1000, 1834, 3000):
        settings = {"force_control.tooth_damping_n_s_per_m": damping, "force_control.tooth_stiffness_n_per_m": 10}
        yield ["teeth", str(damping), *bites(masseter, TEETH, 60, settings)]


def main() -> None:
    masseter = sys.argv[1]
    each = ["rms, µm", "largest, µm"]
    table(["feed-forward", *(f"{rate}: {what}" for rate in ("1.43 Hz", "2.17 Hz") for what in each)], feed_forward(masseter))
    table(["model", "rms, N", "99 %, N", "largest, N", "mean uncertainty, N"], estimate(masseter))
    table(["bite on", "desired, N", "overshoot", "rms error of the hold"], force_control(masseter))
    table(["force by", "friction in the model", "mean error of the hold", "rms error of the hold"], load_cell(masseter))
    table(["bite on", "damping, N s/m", "overshoot", "rms error of the hold"], limit(masseter))


main()
