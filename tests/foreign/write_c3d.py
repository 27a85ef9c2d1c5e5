"""The library ezc3d writes the recorded markers of an example as C3D; the rig reads the same places, lost markers and rate.

    write_c3d.py MASSETER FOLDER

The plain form (`masseter motion FILE --write`) is compared with what went into the file, and a run plays the file.
"""

import csv
import subprocess
import sys
from pathlib import Path

import ezc3d
import numpy as np

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = ["jaw:LI", "jaw:RM", "R"]
# A float has 24 bits: some 0.00003 mm at 300 mm.
TOLERANCE_MM = 5e-5
LOST = range(40, 44)
SCENARIO = EXAMPLES / "markers.toml"


def rows(text):
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    head, *cells = csv.reader(lines)
    return head, np.array([[float(cell) if cell else np.nan for cell in row] for row in cells])


def write(path, places, rate_hz, unit_mm, unit):
    """Frames × 3 markers × 3 coordinates, mm; NaN for a lost marker."""
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["UNITS"]["value"] = [unit]
    file["parameters"]["POINT"]["RATE"]["value"] = [rate_hz]
    file["parameters"]["POINT"]["LABELS"]["value"] = NAMES
    points = np.ones((4, len(NAMES), len(places)))
    points[:3] = np.transpose(places, (2, 1, 0)) / unit_mm
    # Some writers leave a lost point without numbers, others give it a negative residual.
    lost = np.isnan(points[0])
    residuals = np.where(lost, -1.0, 0.0)
    residuals[:, LOST.start] = 0.0
    points[:3, lost & (residuals < 0)] = 0.0
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals[np.newaxis]
    file["data"]["meta_points"]["camera_masks"] = np.zeros((7, *residuals.shape), dtype=bool)
    file["parameters"]["ANALOG"]["RATE"]["value"] = [2 * rate_hz]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["EMG_R"]
    file["data"]["analogs"] = np.ones((1, 1, 2 * len(places)))
    file.write(str(path))


def main():
    masseter, folder = sys.argv[1], Path(sys.argv[2])
    head, recorded = rows((EXAMPLES / "markers.csv").read_text())
    assert len(head) == 10, head
    rate_hz = (len(recorded) - 1) / (recorded[-1, 0] - recorded[0, 0])
    places = recorded[:, 1:].reshape(-1, 3, 3).copy()
    places[LOST, 1] = np.nan
    for unit, unit_mm in (("mm", 1.0), ("m", 1000.0)):
        path, plain = folder / f"{unit}.c3d", folder / f"{unit}.csv"
        write(path, places, rate_hz, unit_mm, unit)
        found = subprocess.run([masseter, "motion", path, "--scenario", SCENARIO, "--write", plain], capture_output=True, text=True)
        assert found.returncode == 0, found.stdout + found.stderr
        for part in ("format C3D: 3 markers, frames 1 to", "'R' is mR", "analog channels are not read: 'EMG_R'", "4 rows"):
            assert part in found.stdout, (part, found.stdout)
        _, read = rows(plain.read_text())
        kept = np.delete(np.arange(len(places)), LOST)
        assert read.shape == (len(kept), 10), read.shape
        off = np.abs(read[:, 1:] - places[kept].reshape(-1, 9)).max()
        assert off < TOLERANCE_MM, off
        assert np.abs(read[:, 0] - kept / rate_hz).max() < 1e-6
    path = folder / "mm.c3d"
    out = folder / "run"
    ran = subprocess.run([masseter, "run", SCENARIO, "--trajectory", path, "--duration", "1", "--clock", "virtual", "--quiet", "--out", out],
                         capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    again = subprocess.run([masseter, "report", out], capture_output=True, text=True)
    assert again.returncode == 0, again.stdout + again.stderr
    path.write_bytes(path.read_bytes()[:-500])
    cut = subprocess.run([masseter, "motion", path, "--scenario", SCENARIO], capture_output=True, text=True)
    assert cut.returncode != 0 and "cut short at frame" in cut.stderr, cut.stderr
    print("C3D: ezc3d's files are read to", TOLERANCE_MM, "mm")


main()
