"""A second judge over random runs: faults and stimuli of all kinds that a run in virtual time can have, drawn from one seed. The raw
recording of each run is judged here against the path of desired_path.py, and the verdict must not be better than that.

    second_judge.py MASSETER FOLDER --runs 40 --seed 7

Of a run with exit code 0 all of this holds:
- At each cycle of the motion, until a stop, the true jaw is within the limits of the scenario's path, at one of the lags that checks
  allow.
- A passed requirement on the incisal point's error holds in each of these cycles, too, at one of the lags.
- The master stopped nothing, unless the scenario expects a safe stop; then the first fault stands in the reason.
- The jaw stands still once the drives are off.

A contradiction leaves its scenario and its recording in the folder, and the exit code is 1. Not covered: rates and amplitudes that
change, external controllers, real time.
"""

import argparse
import functools
import json
import math
import random
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages

from desired_path import RUNNING, DesiredPath, incisal, of_quaternion

PERIOD_S = 1e-3
LIMIT_M, LIMIT_RAD, LAG_S, STANDSTILL_M = 0.5e-3, math.radians(0.5), 20e-3, 0.5e-3
REQUIRED_M = 0.3e-3
# Poses are published with ten digits.
ROUNDING_M = 2e-9
# The plan refuses some pairs of faults. More of them would test little.
MOST_REFUSED = 0.2
FINISHED, MASTERS_FAULT = 6, (2, 1)
OPERATION_ENABLED, ALL_AXES = 5, 63
# With complete readings of enabled drives the motion begins after so many cycles at the latest: those of `controller.ease_s`, by default
# 1 s, and three.
EASE_S, MORE_CYCLES = 1.0, 3

AXES = ("d1", "d2", "d3", "l1", "l2", "l3")
# Kinds with the range of their size, in the unit that the size is written with.
SIZED = {
    "encoder_offset": (-2, 2, "mm"), "encoder_drift": (-20, 20, "mm/s"), "encoder_noise": (1, 100, "um"), "encoder_steps": (1, 200, "um"),
    "encoder_loses": (1, 50, "%"), "encoder_delay": (1, 20, "ms"), "drive_torque_loss": (5, 100, "%"), "drive_reboot": (50, 900, "ms"),
    "drive_scale": (0.8, 1.2, ""), "emcy_storm": (1, 50, "ms"), "friction": (1, 30, ""), "play": (0.01, 1, "mm"), "end_stop": (0, 20, "mm"),
    "payload": (0.05, 3, "kg"), "command_jump": (-2, 2, "mm"), "controller_stall": (1, 60, "ms"),
}
OF_AXIS = ("encoder_stuck", "encoder_sign", "drive_fault", "drive_ignores_targets", "drive_runaway", "drive_sto", "brake_open", "jam", "broken_rod")
PLAIN = ("command_nan", "command_version", "command_foreign")
OF_BUS = ("corrupt", "lose", "duplicate", "delay")
OF_NODE = ("disconnect", "bus_off", "babble")
WITHOUT_AXIS = ("payload", "controller_stall")


def fault(draw):
    kind = draw.choice([*SIZED, *OF_AXIS, *PLAIN, *OF_BUS, *OF_NODE])
    entry = {"kind": kind, "at_s": round(draw.uniform(0, 2.8), 3), "for_s": round(10 ** draw.uniform(-3, 0), 4)}
    if kind in OF_BUS or kind in OF_NODE:
        entry["bus"] = draw.randrange(2)
    if kind in OF_BUS:
        entry["probability"] = round(10 ** draw.uniform(-3, 0), 4)
    if kind in OF_NODE:
        entry["node"] = 1 + 3 * entry["bus"] + draw.randrange(3)
    if kind == "delay":
        entry["size"] = f"{draw.uniform(50, 2000):.0f} us"
    if kind in OF_AXIS or (kind in SIZED and kind not in WITHOUT_AXIS):
        entry["axis"] = draw.choice(AXES)
    if kind in SIZED:
        low, high, unit = SIZED[kind]
        entry["size"] = f"{draw.uniform(low, high):.3f} {unit}".strip()
    return entry


def stimulus(draw):
    at = {"at_s": round(draw.uniform(0, 2.5), 3), "for_s": round(draw.uniform(0.01, 1), 3)}
    match draw.randrange(3):
        case 0:
            return at | {"push_n": [round(draw.uniform(-60, 60), 1) for _ in range(3)], "shape": draw.choice(["step", "ramp", "half_sine"])}
        case 1:
            return at | {"payload": f"{draw.uniform(0.05, 1):.3f} kg"}
        case _:
            return at | {"food.kind": draw.choice(["soft", "peanut", "gum"])}


def table(name, entry):
    return f"[[{name}]]\n" + "".join(f"{key} = {json.dumps(value)}\n" for key, value in entry.items())


def scenario(draw):
    """A scenario of a short motion, whose end faults meet, too; and whether it expects a safe stop."""
    motion = draw.choice(
        [
            {"kind": "chewing"},
            {"kind": "chewing", "side": "right", "vertical_mm": 14.0, "lateral_mm": 3.0, "cycle_rate_hz": 1.0},
            {"kind": "protrusion", "amplitude_mm": 6.0},
            {"kind": "lateral", "amplitude_mm": 5.0},
        ]
    )
    expects_stop = draw.random() < 0.3
    ease_s = draw.choice([None, None, 0.3, 0.55, 1.7])
    text = "duration_s = 3.0\nrecording.frames = false\n" + "".join(f"motion.{key} = {json.dumps(value)}\n" for key, value in motion.items())
    text += "expect.verdict = 'safe_stop'\n" if expects_stop else ""
    text += f"controller.ease_s = {ease_s}\n" if ease_s else ""
    seed = f"seed = {draw.randrange(1 << 30)}\n"
    text += f"[[require]]\nname = 'near'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '{1e3 * REQUIRED_M} mm'\n"
    text += "".join(table("faults", fault(draw)) for _ in range(draw.choice([0, 1, 1, 1, 2, 3])))
    text += "".join(table("stimulus", stimulus(draw)) for _ in range(draw.choice([0, 0, 1, 2])))
    return seed + text, expects_stop


def without_faults(text):
    return text.split("\n", 1)[1].split("[[")[0].replace("expect.verdict = 'safe_stop'\n", "")


class Run:
    """The raw recording of a run."""

    def __init__(self, folder, ease_s):
        self.truths, self.states, self.faults, ready = {}, {}, [], []
        for message in read_ros2_messages(folder / "recording.mcap", topics=("truth", "reading", "state", "event")):
            at = message.ros_msg
            match message.channel.topic:
                case "truth":
                    self.truths[at.cycle] = at
                case "reading" if at.fresh_axes == ALL_AXES and set(at.drive_state) == {OPERATION_ENABLED}:
                    ready.append(at.cycle)
                case "state":
                    self.states[at.cycle] = at.controller_state
                case "event" if (at.source, at.kind) == MASTERS_FAULT:
                    self.faults.append(at)
        stopped = min((at.cycle for at in self.faults), default=math.inf)
        running = [cycle for cycle, state in self.states.items() if state == RUNNING and cycle < stopped]
        lead_in = math.ceil(ease_s / PERIOD_S + MORE_CYCLES)
        begins = min([*running, *sorted(ready)[lead_in : lead_in + 1]], default=0)
        # Every cycle of the motion counts, also one in which the controller reports another state, or none.
        self.running = list(range(begins, max(running, default=begins - 1) + 1))
        self.last = max(self.states)
        self.final_state = self.states[self.last]

    def pose(self, cycle):
        at = self.truths[cycle]
        return np.array(at.position_m), of_quaternion(*at.quaternion_wxyz)


@functools.cache
def path_of(motion):
    """The poses of each cycle of a motion of 3 s."""
    path = DesiredPath(tomllib.loads(motion), Path())
    return [path.pose(PERIOD_S * place) for place in range(round(path.duration_s / PERIOD_S) + 200)]


def farthest(run, path):
    """The largest distance of the jaw from its path, as a share of the limits, and that of the incisal point, m. In each cycle the lag
    counts with which the jaw is nearest; where a truth is missing, no distance is small enough."""
    worst, error_m = 0.0, 0.0
    began = run.running[0] if run.running else 0
    for cycle in run.running:
        if cycle not in run.truths:
            return math.inf, math.inf
        position, rotation = run.pose(cycle)
        if not (np.isfinite(position).all() and np.isfinite(rotation).all()):
            return math.inf, math.inf
        shares, distances = [], []
        for lag in range(round(LAG_S / PERIOD_S) + 1):
            desired = path[min(max(cycle - began - lag, 0), len(path) - 1)]
            distance = math.dist(incisal(position, rotation), incisal(*desired))
            cosine = np.clip((np.trace(rotation.T @ desired[1]) - 1) / 2, -1, 1)
            shares.append(max(distance / LIMIT_M, math.acos(cosine) / LIMIT_RAD))
            distances.append(distance)
            if shares[-1] < 0.2:
                break
        worst, error_m = max(worst, min(shares)), max(error_m, min(distances))
    return worst, error_m


def contradictions(run, path, summary, expects_stop):
    verdict = summary["verdict"]
    if verdict["exit_code"] != 0:
        return
    checks = {check["name"]: check["result"] for check in verdict["checks"]}
    share, error_m = farthest(run, path)
    if share > 1 + 1e-6:
        yield f"the jaw was {share:.2f} times its limits from the path"
    if checks.get("near") == "passed" and error_m > REQUIRED_M + ROUNDING_M:
        yield f"a requirement of {1e3 * REQUIRED_M} mm passed with {1e3 * error_m:.4f} mm"
    if not expects_stop and (run.faults or run.final_state != FINISHED):
        yield f"passed in state {run.final_state} with the faults {[(at.source, at.cause) for at in run.faults][:3]}"
    # The plant goes on for half a second after the controller's last cycle.
    after = [incisal(*run.pose(cycle)) for cycle in sorted(run.truths) if cycle > run.last + 1]
    moved_m = max((math.dist(place, after[0]) for place in after), default=math.inf)
    if not moved_m <= STANDSTILL_M:
        yield f"the jaw moved by {1e3 * moved_m:.3f} mm after the end"
    if expects_stop and not any(word in verdict["reason"] for word in ("first fault: ", " → detected")):
        yield f"an expected stop without its fault: {verdict['reason']}"


def play(masseter, number, seed, folder):
    draw = random.Random(f"{seed} {number}")
    text, expects_stop = scenario(draw)
    file, out = folder / f"{number}.toml", folder / str(number)
    file.write_text(text)
    command = [masseter, "run", file, "--clock", "virtual", "--quiet", "--out", out]
    code = subprocess.run(command, capture_output=True, text=True)
    if code.returncode == 2:
        # The plan refuses some pairs, such as two babbling nodes.
        file.unlink()
        return "refused", [], code.stderr
    summary = json.loads((out / "summary.json").read_text())
    found = [f"exit {code.returncode}, summary {summary['verdict']['exit_code']}"] if code.returncode != summary["verdict"]["exit_code"] else []
    ease_s = tomllib.loads(text).get("controller", {}).get("ease_s", EASE_S)
    found += contradictions(Run(out, ease_s), path_of(without_faults(text)), summary, expects_stop)
    if not found:
        shutil.rmtree(out)
        file.unlink()
    return summary["verdict"]["word"], found, ""


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("masseter")
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--runs", type=int, default=40)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("--seed", type=int, default=1)
    chosen = arguments.parse_args()
    words, wrong = {}, 0
    for number in range(chosen.first, chosen.first + chosen.runs):
        word, found, refusal = play(chosen.masseter, number, chosen.seed, chosen.folder)
        words[word] = words.get(word, 0) + 1
        if refusal and words[word] < 4:
            print(f"run {number}: {refusal.splitlines()[0]}")
        for text in found:
            print(f"run {number}, {word}: {text}")
        wrong += bool(found)
    print(f"second judge: {chosen.runs} runs of seed {chosen.seed}, {wrong} contradictions; " + ", ".join(f"{n} {w}" for w, n in sorted(words.items())))
    refused = words.get("refused", 0) / chosen.runs
    return 1 if wrong or refused > MOST_REFUSED or not {"PASS", "FAIL"} <= words.keys() else 0


if __name__ == "__main__":
    sys.exit(main())
