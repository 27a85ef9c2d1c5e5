"""The cycles of the jaw a second time, by NumPy from the raw recording and docs/jaw-cycles.md: cut, kind, side, figures, statistics.

    jaw_cycles.py MASSETER FOLDER    # plays four motions

No code of the rig is used. The rule is written over whole arrays at the rate of the recording, so judge and program share no
defect of streaming, thinning or running sums. Not covered: forces, holds of more than ten seconds, and choices by `[study]`.
"""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages

from desired_path import CORNER_M, RAMP_S, RUNNING, DesiredPath

EXAMPLES = Path(__file__).parents[2] / "examples"
MOTIONS = {
    "left": "motion.kind = 'chewing'\nmotion.side = 'left'",
    "right": "motion.kind = 'chewing'\nmotion.side = 'right'\nmotion.vertical_mm = 15.0",
    "lateral": "motion.kind = 'lateral'\nmotion.amplitude_mm = 7.0",
    "patient": f"motion.kind = 'file'\nmotion.path = '{EXAMPLES / 'patient.csv'}'\nmotion.axes = ['+x', '+y', '+z']\nmotion.lowpass_hz = 12.0",
}
# Student's t, 97.5 %, by degrees of freedom from 1 on (tables).
STUDENT_T = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179]
# The judge takes a sample each 4 ms; a beginning and an end may differ by two of them.
WITHIN_S, WITHIN_MM = 0.0081, 0.05


def path_of(run):
    """Times since the motion began, s, and places of the incisal point, mm, base frame, while it plays."""
    began_ns = ended_ns = None
    truths = []
    for message in read_ros2_messages(run / "recording.mcap", topics=("truth", "state")):
        of = message.ros_msg
        if message.channel.topic == "truth":
            truths.append((of.sampled_ns, *of.position_m, *of.quaternion_wxyz))
        elif of.controller_state == RUNNING:
            began_ns, ended_ns = began_ns or of.sampled_ns, of.sampled_ns
    truths = np.array(truths)
    truths = truths[(truths[:, 0] >= began_ns) & (truths[:, 0] <= ended_ns)]
    position, (w, x, y, z) = truths[:, 1:4], truths[:, 4:].T
    corner = CORNER_M * np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1)
    return (truths[:, 0] - began_ns) / 1e9, (position + corner) * 1e3


def movements(away):
    """Indices of the first crossing, the farthest place and the last index of each movement: a zigzag over the distance."""
    found, low, at, high = [], away[0], None, None
    for index, distance in enumerate(away):
        if at is None:
            low = min(low, distance)
            if distance > low + 3:
                at, high = index, index
        elif distance > away[high]:
            high = index
        elif distance < away[high] - max(3, 0.5 * (away[high] - low)):
            found.append((at, high))
            at, low = None, distance
    return found


def cycles_of(times, places, stopped_s):
    away = np.linalg.norm(places, axis=1)
    found = movements(away)
    begins, homes = [], []
    for number, (crossing, _) in enumerate(found):
        since = found[number - 1][1] if number else 0
        rest = away[since:crossing]
        begins.append(since + np.flatnonzero(rest <= rest.min() + 0.5)[-1])
        homes.append(since + np.argmin(away[since : begins[-1] + 1]))
    for number, (_, far) in enumerate(found):
        begin, home = begins[number], places[homes[number]]
        end = begins[number + 1] if number + 1 < len(found) else len(away) - 1
        tail = away[far : end + 1]
        closed = far + np.flatnonzero(tail <= tail.min() + 0.5)[0]
        is_last = number + 1 == len(found) or times[end] - times[closed] > 0.5
        if is_last:
            end = closed + np.searchsorted(times[closed:], times[closed] + 0.5) - 1
        ways = places[begin : end + 1] - home
        down, forward, left, right = -ways[:, 2].min(), ways[:, 0].max(), ways[:, 1].max(), -ways[:, 1].min()
        down, forward, left, right = (max(0.0, way) for way in (down, forward, left, right))
        out = np.linalg.norm(places[far] - home)
        stays = np.linalg.norm(places[begin : closed + 1] - places[far], axis=1) <= max(0.5, 0.05 * out)
        leaves = np.flatnonzero(~stays)
        before, after = leaves[leaves < far - begin], leaves[leaves > far - begin]
        held = [begin + (before[-1] + 1 if before.size else 0), begin + (after[0] - 1 if after.size else closed - begin)]
        hold_s = times[held[1]] - times[held[0]]
        if hold_s <= (times[closed] - times[begin]) / 3:
            held, hold_s = [far, far], 0.0
        move_s = times[held[0]] - times[begin] + times[closed] - times[held[1]]
        back = places[far : end + 1, 1] - home[1]
        kind, side = "unclear", None
        if np.linalg.norm(places[closed : end + 1] - home, axis=1).min() <= max(1.0, 0.2 * out):
            glides = [way >= 2 and way >= 0.5 * down and down <= 10 for way in (max(left, right), forward)]
            if glides[0] and max(left, right) >= forward:
                kind, side = "lateral", "left" if left > right else "right"
            elif glides[1]:
                kind = "protrusive"
            elif hold_s == 0 and move_s <= 2 and 5 <= down < 30:
                sides = (back.max() >= 1, back.min() <= -1)
                kind, side = "chew", {(True, False): "left", (False, True): "right"}.get(sides, "both")
            elif down >= 10:
                kind = "opening"
        window = slice(begin, closed + 1 if is_last else end + 1)
        is_ramped = times[window].min() < RAMP_S or times[window].max() > stopped_s - RAMP_S
        meets = (np.abs(places[closed : end + 1, 2]) <= 1).any()
        yield {
            "kind": kind, "side": side, "left_out": "ramp" if is_ramped else None, "began_s": times[begin],
            "duration_s": None if is_last else times[end] - times[begin], "opening_s": times[held[0]] - times[begin], "hold_s": hold_s,
            "closing_s": times[closed] - times[held[1]], "occlusal_s": times[end] - times[closed] if meets and not is_last else None,
            "opening_mm": down, "lateral_mm": left + right, "forward_mm": forward,
        }  # fmt: skip


def assert_same(cycle, expected, name):
    for key, value in expected.items():
        found, where = cycle[key], (name, cycle["number"], key, cycle[key], value)
        if isinstance(value, float) and found is not None:
            # Opening, hold and closing share the farthest place, which lies where the jaw hardly moves.
            within = WITHIN_MM if key.endswith("_mm") else WITHIN_S * (1 if key in ("began_s", "duration_s", "occlusal_s") else 4)
            assert abs(found - value) <= within, where
        else:
            assert found == value, where


def assert_statistics(group, cycles, name):
    members = [of for of in cycles if (of["kind"], of["side"], of["left_out"]) == (group["kind"], group["side"], None)]
    assert len(members) == group["count"] > 0, (name, group)
    for quantity in group["quantities"]:
        values = np.array([of[quantity["name"]] for of in members if of[quantity["name"]] is not None])
        expected = {"count": len(values), "mean": values.mean(), "median": np.median(values)}
        if len(values) > 1:
            sd = values.std(ddof=1)
            half = STUDENT_T[len(values) - 2] * sd / np.sqrt(len(values))
            expected["sd"] = sd
            ends = np.array([quantity["mean"] - quantity["mean_low"], quantity["mean_high"] - quantity["mean"]])
            assert np.allclose(ends, half, rtol=2e-3, atol=1e-9), (name, quantity, half)
        for key, value in expected.items():
            assert np.isclose(quantity[key], value, rtol=1e-9, atol=1e-9), (name, quantity, key, value)


def main():
    masseter, folder = sys.argv[1], Path(sys.argv[2])
    kinds = set()
    for name, text in MOTIONS.items():
        scenario, run = folder / f"{name}.toml", folder / name
        scenario.write_text(text + "\nrecording.frames = false\n")
        words = [masseter, "run", scenario, "--clock", "virtual", "--quiet", "--out", run]
        subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
        found = json.loads((run / "summary.json").read_text())["figures"]["jaw_cycles"]
        times, places = path_of(run)
        desired = DesiredPath(tomllib.loads(text), folder)
        closed = 1e3 * (desired.closed + [CORNER_M, 0, 0])
        expected = list(cycles_of(times, places - closed, desired.stopped_s))
        assert len(expected) == found["count"], (name, len(expected), found["count"])
        for cycle, other in zip(found["cycles"], expected):
            assert_same(cycle, other, name)
        for group in found["groups"]:
            assert_statistics(group, found["cycles"], name)
        kinds |= {(group["kind"], group["side"]) for group in found["groups"]}
    needed = {("chew", "left"), ("chew", "right"), ("opening", None), ("protrusive", None), ("lateral", "left"), ("lateral", "right")}
    assert needed <= kinds, needed - kinds
    print("jaw cycles: NumPy finds the same in", len(MOTIONS), "motions")


main()
