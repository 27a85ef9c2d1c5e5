"""Writes jaw.csv and markers.csv beside this file: one made-up motion of 2 s, as poses and as three markers.

The jaw opens and closes twice. At the time t, with s = (1 − cos 2πt) / 2, the middle between the condyles is at
(4 s, s sin 2πt, −3 s) mm, and the jaw is turned by 10° s about it, around the axis that points left.
"""

from math import cos, pi, radians, sin
from pathlib import Path

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


def write(name, columns, row):
    times_s = (index / RATE_HZ for index in range(RATE_HZ * DURATION_S + 1))
    lines = (",".join([f"{time_s:.2f}", *(f"{value + 0:.6f}" for value in row(time_s))]) for time_s in times_s)
    head = "# Made up: nobody's jaw. examples/recordings.py says how, and makes it again.\ntime_s," + ",".join(columns)
    Path(__file__).with_name(name).write_text("\n".join([head, *lines]) + "\n")


write("jaw.csv", ["x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"], pose)
write("markers.csv", [f"m{marker}_{axis}_mm" for marker in (1, 2, 3) for axis in "xyz"], markers)
