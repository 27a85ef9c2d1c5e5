"""Computes the margins of a run's requirements with `rtamt` (signal temporal logic, discrete time) from its recording,
and compares them with those of the run's summary. Neither signals nor semantics are Masseter's here.

    read_margins.py RUN_FOLDER        # a run of margins.toml
"""

import json
import math
import sys

import rtamt
from mcap_ros2.reader import read_ros2_messages

RUNNING = 3
ALWAYS = 1e9  # An indicator so large that it decides every minimum and maximum.

folder = sys.argv[1]
cycles = {}
for message in read_ros2_messages(f"{folder}/recording.mcap", topics=("reading", "truth", "state")):
    cycles.setdefault(message.ros_msg.cycle, {})[message.channel.topic] = message.ros_msg
rows = [row for _, row in sorted(cycles.items()) if len(row) == 3]

error = [math.dist(row["truth"].position_m, row["state"].desired_position_m) for row in rows]
has_desired = [math.hypot(*row["state"].desired_quaternion_wxyz) > 0.5 for row in rows]
forces = [[row["reading"].force_n[axis] for row in rows] for axis in range(6)]
is_running = [row["state"].controller_state == RUNNING for row in rows]
began = is_running.index(True)
seconds = [(row["reading"].sampled_ns - rows[began]["reading"].sampled_ns) / 1e9 for row in rows]


def indicator(values):
    return [ALWAYS if value else -ALWAYS for value in values]


def robustness(formula, **signals):
    """The robustness at the first sample."""
    spec = rtamt.StlDiscreteTimeSpecification()
    for name in signals:
        spec.declare_var(name, "float")
    spec.spec = formula
    spec.parse()
    data = {"time": list(range(len(rows)))} | signals
    return spec.evaluate(data)[0][1]


# A pose that is none has no error: the condition does not hold there.
above = [known and value >= 8e-6 for known, value in zip(has_desired, error)]
rises = [now and not before for now, before in zip(above, [False] + above[:-1])]
expected_mm = {
    "error": robustness("always((w >= 0) implies (e <= 0.05))", w=indicator(is_running), e=[1e3 * e for e in error]),
    "recovery": robustness(
        "always((w >= 0) implies eventually[0:60](always[0:10](e <= 0.005)))",
        w=indicator(rise and runs for rise, runs in zip(rises, is_running)),
        e=[1e3 * value if known else 1e9 for known, value in zip(has_desired, error)],
    ),
}
expected_n = {
    "force": robustness(
        "always((w >= 0) implies ((f >= -40) and (f <= 20)))",
        w=indicator(1.0 <= at <= 3.0 for at in seconds),
        f=forces[3],
    ),
    "never": robustness("always(not (f >= 60))", f=forces[4]),
}

found = {check["name"]: check for check in json.load(open(f"{folder}/summary.json"))["verdict"]["checks"]}
for name, expected in (expected_mm | expected_n).items():
    check = found[name]
    print(f"{name:9} {check['result']:7} margin {check['margin']:.9g} {check['margin_unit']}, rtamt {expected:.9g}")
    assert abs(check["margin"] - expected) <= 1e-9 * max(1.0, abs(expected)), (name, check["margin"], expected)
    assert (check["result"] == "passed") == (expected >= 0), (name, check["result"], expected)
assert {found[name]["result"] for name in expected_mm | expected_n} == {"passed", "failed"}, "all alike show little"
