"""Writes made-up recordings beside this file: a plain motion of 2 s (jaw.csv, markers.csv), and what a session with a
patient may look like (patient.csv, tracker.csv), each as poses and as three markers.

The jaw opens and closes twice. At the time t, with s = (1 − cos 2πt) / 2, the middle between the condyles is at
(4 s, s sin 2πt, −3 s) mm, and the jaw is turned by 10° s about it, around the axis that points left.

The session has the phases of SESSION, the rates of common trackers, irregular chewing cycles and a tracker's noise.
"""

from math import cos, pi, radians, sin, sqrt
from pathlib import Path
from random import Random

RATE_HZ, DURATION_S = 100, 2
# From the incisal point, in the jaw's frame (x anterior, y left, z up), mm.
CONDYLES = (-80.0, 0.0, 33.1)
MARKERS = ((0.0, 0.0, 10.0), (0.0, 15.0, -5.0), (0.0, -15.0, -5.0))
# Where the tracker sees the incisal point of the closed jaw.
TRACKER = (100.0, 200.0, 300.0)


def motion(time_s):
    """Displacement of the middle between the condyles, mm, and the turn, rad."""
    share = (1 - cos(2 * pi * time_s)) / 2
    return (4 * share, share * sin(2 * pi * time_s), -3 * share), radians(10 * share)


# Start and duration, s; opening, °; both condyles along their paths, mm; to the left, mm; turn to the left, °.
SESSION = (
    (0.4, 2.6, 28.0, 12.0, 0.8, 0.5),
    (3.5, 0.86, 9.5, 4.0, -3.1, -1.8),
    (4.36, 0.74, 11.0, 4.6, -3.6, -2.2),
    (5.10, 0.69, 10.2, 4.1, -2.9, -1.7),
    (5.79, 0.81, 8.4, 3.4, -3.8, -2.3),
    (6.85, 0.72, 10.8, 4.4, 3.3, 1.9),
    (7.57, 0.66, 9.1, 3.9, 2.7, 1.6),
    (8.23, 0.78, 10.0, 4.2, 3.5, 2.1),
    (9.6, 1.7, 1.5, 5.0, 0.2, 0.1),
    (11.8, 1.4, 2.0, 1.2, 5.0, 2.6),
    (13.5, 1.5, 2.2, 1.3, -4.6, -2.4),
)
CONDYLAR_PATH = radians(40)
NOISE_MM, NOISE_DEG = 0.02, 0.015


def there_and_back(share):
    """From 0 over 1 to 0 without a jerk at the ends."""
    way = max(0.0, 1 - abs(2 * share - 1))
    return way**3 * (10 - 15 * way + 6 * way**2)


def session(time_s, noise):
    """Displacement of the middle between the condyles, mm, and the quaternion of the jaw's turn, with noise."""
    turn, along, left, yaw = 0.0, 0.0, 0.0, 0.0
    for start_s, duration_s, *ends in SESSION:
        now = there_and_back((time_s - start_s) / duration_s)
        turn, along, left, yaw = (a + now * b for a, b in zip((turn, along, left, yaw), ends))
    shift = (along * cos(CONDYLAR_PATH), left, -along * sin(CONDYLAR_PATH))
    turn, yaw, roll = (radians(angle + noise.gauss(0, NOISE_DEG)) / 2 for angle in (turn, yaw, 0.0))
    # Turned to the left in the opened jaw's frame; the roll is noise alone.
    quaternion = (cos(turn) * cos(yaw), sin(turn) * sin(yaw) + roll, sin(turn) * cos(yaw), cos(turn) * sin(yaw))
    length = sqrt(sum(part * part for part in quaternion))
    return [at + noise.gauss(0, NOISE_MM) for at in shift], [part / length for part in quaternion]


def rotated(quaternion, point):
    """The point turned by a unit quaternion."""
    (w, *axis), cross = quaternion, lambda a, b: [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]
    twice = [2 * part for part in cross(axis, point)]
    return [p + w * t + c for p, t, c in zip(point, twice, cross(axis, twice))]


def session_pose(noise):
    return lambda time_s: [part for parts in session(time_s, noise) for part in parts]


def session_markers(noise):
    def row(time_s):
        shift, quaternion = session(time_s, noise)
        for marker in MARKERS:
            turned = rotated(quaternion, [at - centre for at, centre in zip(marker, CONDYLES)])
            x, y, z = (a + b + c for a, b, c in zip(turned, CONDYLES, shift))
            yield from (TRACKER[0] - y, TRACKER[1] + x, TRACKER[2] + z)

    return row


def pose(time_s):
    shift, turn = motion(time_s)
    return [*shift, cos(turn / 2), 0.0, sin(turn / 2), 0.0]


def markers(time_s):
    """As the tracker sees them: its y points anterior, its x to the right."""
    shift, turn = motion(time_s)
    for marker in MARKERS:
        x, y, z = (at - centre for at, centre in zip(marker, CONDYLES))
        turned = (x * cos(turn) + z * sin(turn), y, z * cos(turn) - x * sin(turn))
        x, y, z = (a + b + c for a, b, c in zip(turned, CONDYLES, shift))
        yield from (TRACKER[0] - y, TRACKER[1] + x, TRACKER[2] + z)


def write(name, columns, row, rate_hz=RATE_HZ, duration_s=DURATION_S, digits=6):
    times_s = (index / rate_hz for index in range(round(rate_hz * duration_s) + 1))
    lines = (",".join([f"{time_s:.3f}".removesuffix("0"), *(f"{value + 0:.{digits}f}" for value in row(time_s))]) for time_s in times_s)
    head = "# Made up: nobody's jaw. examples/recordings.py says how, and makes it again.\ntime_s," + ",".join(columns)
    Path(__file__).with_name(name).write_text("\n".join([head, *lines]) + "\n")


POSE = ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
MARKER_COLUMNS = [f"m{marker}_{axis}_mm" for marker in (1, 2, 3) for axis in "xyz"]
write("jaw.csv", POSE, pose)
write("markers.csv", MARKER_COLUMNS, markers)
write("patient.csv", POSE, session_pose(Random(1)), rate_hz=66.7, duration_s=15.6, digits=5)
write("tracker.csv", MARKER_COLUMNS, session_markers(Random(2)), rate_hz=50, duration_s=15.6, digits=3)
