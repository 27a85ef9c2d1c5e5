"""The desired path of the jaw, by NumPy from the scenario alone: Bonwill's triangle on two condylar paths, recorded poses, recorded
markers, and the clock that starts and stops a motion. No code of the rig is used, so judge and controller share no defect with it.

    desired_path.py MASSETER FOLDER    # plays every kind of motion

The controller's pose is compared in every cycle, the judge's by its least and largest values and by the errors from it. The motion
begins with the first cycle in the state `running`. Not covered: rate and amplitude that change, force control, pauses, and mechanisms other than the paper's.
"""

import csv
import json
import math
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages

EXAMPLES = Path(__file__).parents[2] / "examples"
RUNNING = 3
RAMP_S = 0.5
CORNER_M = 0.05 / math.sqrt(3)
ADVANCE_PER_PITCH_M = 0.0148 / math.radians(32.2)
# Poses are published with ten digits.
TOLERANCE_M = 1e-9

AXES = {sign + name: direction * np.eye(3)[place] for place, name in enumerate("xyz") for sign, direction in (("+", 1), ("-", -1))}
CHEWING = {"vertical_mm": 18.0, "lateral_mm": 4.0, "anterior_posterior_mm": 5.0, "cycle_rate_hz": 1.43}


def jerk(x):
    """From rest to rest with the least jerk."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10 - 15 * x + 6 * x**2)


def bisect(travel, amplitude, highest):
    """The coordinate at which a rising travel is the amplitude; beyond its reach there is none."""
    low, high = 0.0, highest
    for _ in range(60):
        middle = (low + high) / 2
        at = travel(middle)
        low, high = (middle, high) if at is not None and at < amplitude else (low, middle)
    return low


def turn(vector):
    """The rotation by a rotation vector (Rodrigues)."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle else vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def turn_vector(rotation):
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    angle = math.atan2(np.linalg.norm(axis), np.trace(rotation) - 1)
    return axis / np.linalg.norm(axis) * angle if angle > 1e-12 else axis / 2


def of_quaternion(w, x, y, z):
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    w, v = w / norm, np.array([x, y, z]) / norm
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross


class Mandible:
    """Condyles that glide on straight paths; the balancing one turns inward, the working one gives way to the side."""

    def __init__(self, motion):
        height, balkwill = 0.1 * math.sqrt(3) / 2, math.radians(22.5)
        self.middle = height * np.array([-math.cos(balkwill), 0, math.sin(balkwill)])
        slope, bennett = math.radians(motion.get("condylar_inclination_deg", 40.0)), math.radians(motion.get("bennett_angle_deg", 8.0))
        self.side = -1 if motion.get("side", "left") == "right" else 1
        self.path = np.array([math.cos(slope), 0, -math.sin(slope)])
        inward = math.cos(slope) * math.sin(bennett)
        self.balancing = np.array([math.cos(slope) * math.cos(bennett), self.side * inward, -math.sin(slope)])
        # The last posture, from which the next one is sought.
        self.near = np.zeros(2)

    def line(self, balancing_m):
        """Both condyles after the balancing one has advanced: their middle's shift, and the turn of their line from +y."""
        gone = self.balancing * balancing_m
        across = math.sqrt(0.1**2 - gone[0] ** 2 - gone[2] ** 2)
        # The balancing condyle goes where its path leads, the working one as far aside as their distance demands.
        balancing = np.array([0, -self.side * 0.05, 0]) + gone
        working = np.array([0, balancing[1] + self.side * across, 0])
        left_to_right = self.side * (working - balancing) / 0.1
        axis = np.cross([0, 1, 0], left_to_right)
        sine = np.linalg.norm(axis)
        rotation = turn(axis / sine * math.atan2(sine, left_to_right[1])) if sine else np.eye(3)
        return (balancing + working) / 2, rotation

    def moved(self, pitch, advance_m, balancing_m):
        """The incisal point's shift, and the jaw's turn."""
        shift, rotation = self.line(balancing_m)
        rotation = rotation @ turn(np.array([0, pitch, 0]))
        return self.middle + shift + self.path * advance_m - rotation @ self.middle, rotation

    def reaching(self, ahead_m, up_m, balancing_m):
        """Pitch and advance with which the incisal point is there in the midsagittal plane, by Newton; none out of reach."""
        at, goal, step = self.near, np.array([ahead_m, up_m]), 1e-7
        place = lambda at: self.moved(*at, balancing_m)[0][[0, 2]]
        for _ in range(50):
            off = place(at) - goal
            if np.linalg.norm(off) < 1e-14:
                self.near = at
                return at
            slopes = np.array([place(at + [step, 0]), place(at + [0, step])]) - (off + goal)
            at = at - np.linalg.solve(slopes.T / step, off)
        return None


class Generated:
    """Chewing, opening, protrusion and lateral excursion, cycle after cycle."""

    def __init__(self, motion):
        self.kind, self.mandible = motion["kind"], Mandible(motion)
        self.rate_hz = motion.get("cycle_rate_hz", CHEWING["cycle_rate_hz"] if self.kind == "chewing" else 0.5)
        shares = motion.get("phases", {})
        self.opening, self.closing = shares.get("opening", 0.43), shares.get("closing", 0.40)
        jaw, side = self.mandible, self.mandible.side
        if self.kind == "chewing":
            self.down, self.aside, self.back = (
                motion.get(key, CHEWING[key]) / 1e3 for key in ("vertical_mm", "lateral_mm", "anterior_posterior_mm")
            )

            def swing(balancing_m):
                posture = jaw.reaching(-self.back, -self.down, balancing_m)
                return None if posture is None else side * jaw.moved(*posture, balancing_m)[0][1]

            self.balancing_m = bisect(swing, self.aside, 0.02)
            return
        amplitude = motion.get("amplitude_mm", {"opening": 35.0, "protrusion": 9.0, "lateral": 8.0}[self.kind]) / 1e3
        if self.kind == "opening":
            pitch = bisect(lambda pitch: np.linalg.norm(jaw.moved(pitch, ADVANCE_PER_PITCH_M * pitch, 0)[0]), amplitude, 0.8)
            self.farthest = np.array([pitch, ADVANCE_PER_PITCH_M * pitch, 0])
        elif self.kind == "protrusion":
            self.farthest = np.array([0, amplitude, 0])
        else:
            self.farthest = np.array([0, 0, bisect(lambda far: side * jaw.moved(0, 0, far)[0][1], amplitude, 0.025)])

    def length_s(self, duration_s):
        return max(1, math.floor((duration_s - RAMP_S) * self.rate_hz + 1e-9)) / self.rate_hz

    def displacement(self, at_s):
        phase = at_s * self.rate_hz % 1.0
        back = 1 - jerk((phase - self.opening) / self.closing)
        opened = jerk(phase / self.opening) if phase < self.opening else back
        if self.kind != "chewing":
            return self.mandible.moved(*(self.farthest * opened))
        begins = 0.3 * self.opening
        swung = jerk((phase - begins) / (self.opening - begins)) if phase < self.opening else back
        balancing_m = self.balancing_m * swung
        return self.mandible.moved(*self.mandible.reaching(-self.back * opened, -self.down * opened, balancing_m), balancing_m)


def spline(times, values):
    """The natural cubic spline, by its second derivatives."""
    spans, count = np.diff(times), len(times)
    system, right = np.eye(count), np.zeros_like(values)
    for knot in range(1, count - 1):
        system[knot, knot - 1 : knot + 2] = spans[knot - 1], 2 * (spans[knot - 1] + spans[knot]), spans[knot]
        right[knot] = 6 * ((values[knot + 1] - values[knot]) / spans[knot] - (values[knot] - values[knot - 1]) / spans[knot - 1])
    curvatures = np.linalg.solve(system, right)

    def at(time):
        left = int(np.clip(np.searchsorted(times, time, "right") - 1, 0, count - 2))
        span = spans[left]
        b = (np.clip(time, times[0], times[-1]) - times[left]) / span
        a = 1 - b
        bends = (a**3 - a) * curvatures[left] + (b**3 - b) * curvatures[left + 1]
        return a * values[left] + b * values[left + 1] + bends * span**2 / 6

    return at


def smoothed(values, rate_hz, corner_hz):
    """A Butterworth filter of second order, forwards and backwards, −3 dB at the corner; the ends are reflected in their points."""
    margin = min(math.ceil(3 * rate_hz / corner_hz), len(values) - 1)
    values = np.concatenate([2 * values[0] - values[margin:0:-1], values, 2 * values[-1] - values[-2 : -margin - 2 : -1]])
    warped = math.tan(math.pi * corner_hz / rate_hz) / (math.sqrt(2) - 1) ** 0.25
    scale = 1 + math.sqrt(2) * warped + warped**2
    for _ in range(2):
        x1 = x2 = y1 = y2 = values[0]
        out = np.empty_like(values)
        for place, x in enumerate(values):
            y = warped**2 * (x + 2 * x1 + x2) - 2 * (warped**2 - 1) * y1 - (1 - math.sqrt(2) * warped + warped**2) * y2
            out[place] = y / scale
            x2, x1, y2, y1 = x1, x, y1, out[place]
        values = out[::-1]
    return values[margin : len(values) - margin]


class Recorded:
    """A file of poses or of three markers, low-passed and joined by a spline."""

    def __init__(self, motion, folder):
        with open(folder / motion["path"]) as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#") and line.strip()))
        times = np.array([float(row.pop("time_s")) for row in rows])
        numbers = np.array([[float(value) for value in row.values()] for row in rows])
        axes = np.array([AXES[name] for name in motion.get("axes", ["+x", "+y", "+z"])])
        moved = [self.of_markers(numbers[0], now, axes, motion) if "m1_x_mm" in rows[0] else self.of_pose(now, axes, motion) for now in numbers]
        self.first = moved[0][1]
        values = np.array([[*shift, *turn_vector(self.first.T @ rotation)] for shift, rotation in moved])
        times -= times[0]
        self.at, self.last_s = spline(times, values), times[-1]
        corner_hz = motion.get("lowpass_hz", 12.0)
        if corner_hz:
            steps = max(math.ceil(self.last_s * 200), len(times) - 1)
            grid = np.linspace(0, self.last_s, steps + 1)
            self.at = spline(grid, smoothed(np.array([self.at(time) for time in grid]), steps / self.last_s, corner_hz))

    @staticmethod
    def of_pose(values, axes, motion):
        rotation = axes @ of_quaternion(*values[3:]) @ axes.T
        point = np.array(motion["reference_point_mm"]) / 1e3 if "reference_point_mm" in motion else Mandible({}).middle
        return point + axes @ values[:3] / 1e3 - rotation @ point, rotation

    @staticmethod
    def of_markers(closed, now, axes, motion):
        closed, now = closed.reshape(3, 3) / 1e3, now.reshape(3, 3) / 1e3
        u, _, v = np.linalg.svd((now - now.mean(0)).T @ (closed - closed.mean(0)))
        rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
        origin = np.array(motion["marker_origin_mm"]) / 1e3 if "marker_origin_mm" in motion else closed.mean(0)
        moved = now.mean(0) + rotation @ (origin - closed.mean(0)) - origin
        return axes @ moved, axes @ rotation @ axes.T

    def length_s(self, _):
        return self.last_s

    def displacement(self, at_s):
        at = self.at(at_s)
        return at[:3], self.first @ turn(at[3:])


class DesiredPath:
    """The platform's pose by the time since the motion began."""

    def __init__(self, scenario, folder):
        motion = {"kind": "chewing"} | scenario.get("motion", {})
        self.motion = Recorded(motion, folder) if motion["kind"] == "file" else Generated(motion)
        jaw = scenario.get("jaw", {})
        length_s = self.motion.length_s(scenario.get("duration_s", 10.0))
        self.duration_s = scenario.get("duration_s", length_s + RAMP_S if motion["kind"] == "file" else 10.0)
        self.ramp_s = min(RAMP_S, length_s, self.duration_s / 2)
        self.stopped_s = min(self.duration_s, length_s + self.ramp_s)
        # Three legs of one length under a platform in the middle: half of the base's triangle is between base and corner.
        height = math.sqrt(jaw.get("closed_leg_m", 0.2974) ** 2 - CORNER_M**2)
        self.closed = np.array([0, 0, height]) + jaw.get("closed_offset_m", [0.0, 0.0, 0.0])

    def motion_s(self, since_s):
        def ramped(time_s):
            x = np.clip(time_s / self.ramp_s, 0, 1)
            return self.ramp_s * (2.5 * x**4 - 3 * x**5 + x**6)

        if since_s < self.ramp_s:
            return ramped(since_s)
        left_s = self.stopped_s - since_s
        return self.stopped_s - self.ramp_s - ramped(left_s) if left_s < self.ramp_s else since_s - self.ramp_s / 2

    def pose(self, since_s):
        """Position (m) and rotation of the platform in the base frame; the incisal point is its first corner."""
        shift, rotation = self.motion.displacement(self.motion_s(since_s))
        corner = np.array([CORNER_M, 0, 0])
        return self.closed + corner + shift - rotation @ corner, rotation


def incisal(position, rotation):
    return position + rotation @ [CORNER_M, 0, 0]


def cycles(recording):
    """The messages of each cycle that has reading, truth and state, in their order."""
    rows = {}
    for message in read_ros2_messages(recording, topics=("reading", "truth", "state")):
        rows.setdefault(message.ros_msg.cycle, {})[message.channel.topic] = message.ros_msg
    return [row for _, row in sorted(rows.items()) if len(row) == 3]


MOTIONS = {
    "chewing": "duration_s = 2.0",
    "right": "duration_s = 2.5\nmotion = {kind = 'chewing', side = 'right', vertical_mm = 15.0, lateral_mm = 3.0, cycle_rate_hz = 1.1,"
    " phases = {opening = 0.4, closing = 0.5, occlusion = 0.1}, bennett_angle_deg = 6.0, condylar_inclination_deg = 37.0}",
    "opening": "duration_s = 3.0\nmotion = {kind = 'opening', amplitude_mm = 30.0}\njaw.closed_offset_m = [0.005, 0.0, 0.0]",
    "protrusion": "duration_s = 3.0\nmotion = {kind = 'protrusion', amplitude_mm = 7.0}",
    "lateral": "duration_s = 3.0\nmotion = {kind = 'lateral', side = 'right', amplitude_mm = 6.0}",
    "cut": "duration_s = 0.9",
    "poses": f"motion = {{kind = 'file', path = '{EXAMPLES}/jaw.csv'}}",
    "unfiltered": f"motion = {{kind = 'file', path = '{EXAMPLES}/jaw.csv', lowpass_hz = 0.0}}\nduration_s = 3.0",
    "markers": f"motion = {{kind = 'file', path = '{EXAMPLES}/markers.csv', axes = ['+y', '-x', '+z'],"
    " marker_origin_mm = [100.0, 200.0, 310.0]}\njaw.closed_offset_m = [0.005, 0.0, 0.0]",
}
REQUIRED = "".join(
    f"[[require]]\nname = '{signal} {key}'\nsignal = '{signal}'\nduring = 'running'\n{key} = '{sign}1 m'\n"
    for signal in ("incisal.desired.x", "incisal.desired.y", "incisal.desired.z", "incisal.error", "platform.error")
    for key, sign in (("min", "-"), ("max", ""))
)


def compare(masseter, name, scenario, folder):
    path = folder / f"{name}.toml"
    path.write_text(f"{scenario}\n{REQUIRED}")
    subprocess.run([masseter, "run", path, "--clock", "virtual", "--quiet", "--out", folder / name], check=True, capture_output=True)
    running = [row for row in cycles(folder / name / "recording.mcap") if row["state"].controller_state == RUNNING]
    desired = DesiredPath(tomllib.loads(path.read_text()), folder)
    own = [desired.pose(1e-3 * place) for place in range(len(running))]
    controller = [math.dist(at[0], row["state"].desired_position_m) for at, row in zip(own, running)]
    corners = np.array([incisal(*at) for at in own])
    truths = [(np.array(row["truth"].position_m), of_quaternion(*row["truth"].quaternion_wxyz)) for row in running]
    errors = [math.dist(incisal(*truth), corner) for truth, corner in zip(truths, corners)]
    series = dict(zip(("incisal.desired.x", "incisal.desired.y", "incisal.desired.z"), corners.T))
    series |= {"incisal.error": errors, "platform.error": [math.dist(truth[0], at[0]) for truth, at in zip(truths, own)]}
    checks = {check["name"]: check for check in json.loads((folder / name / "summary.json").read_text())["verdict"]["checks"]}
    def judged(signal, key):
        """The least or largest value, by the margin to a limit of 1 m."""
        margin_m = checks[f"{signal} {key}"]["margin"] / 1e3
        return 1 - margin_m if key == "max" else margin_m - 1

    judge = [abs(judged(signal, key) - of(values)) for signal, values in series.items() for key, of in (("min", min), ("max", max))]
    print(f"{name:11} {len(running)} cycles, controller's pose within {1e9 * max(controller):.2f} nm, judge's within {1e9 * max(judge):.2f} nm")
    # What is no number is not below the tolerance.
    assert len(running) > 500 and all(off_m < TOLERANCE_M for off_m in [*controller, *judge]), name


if __name__ == "__main__":
    for name, scenario in MOTIONS.items():
        compare(sys.argv[1], name, scenario, Path(sys.argv[2]))
