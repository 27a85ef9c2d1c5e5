"""One recording as trackers write it, in every separator, decimal mark, code page, unit and order of columns: the rig reads the
numbers that NumPy knows, or refuses the file. Not one file may be read otherwise.

    messy_motions.py MASSETER FOLDER [--every N]    # the N-th of the combinations
    messy_motions.py MASSETER FOLDER --cases CASES  # files of this folder too: read or refused, without a truth
"""

import argparse
import csv
import itertools
import json
import subprocess
from pathlib import Path

import numpy as np

ROWS, RATE_HZ = 200, 100.0
# Texts have six decimals, of metres nine.
TOLERANCE = 1e-5
SEPARATORS = [",", ";", "\t", "  "]
MARKS = [".", ","]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "cp1252"]
UNITS = {"mm": 1.0, "cm": 0.1, "m": 0.001}
ORDERS = {
    "plain": ["time", "x", "y", "z", "qw", "qx", "qy", "qz"],
    "scalar last": ["time", "x", "y", "z", "qx", "qy", "qz", "qw"],
    "turn first": ["qw", "qx", "qy", "qz", "z", "y", "x", "time"],
}


def motion():
    """An opening by 12° whose condyles glide forward and down, with an EMG."""
    time = np.arange(ROWS) / RATE_HZ
    share = (1 - np.cos(2 * np.pi * time)) / 2
    half = np.radians(12) * share / 2
    zero = np.zeros(ROWS)
    columns = {"time": time, "x": 4 * share, "y": 0.5 * share, "z": -3 * share, "qw": np.cos(half), "qx": zero, "qy": np.sin(half), "qz": zero}
    return columns | {"EMG µV": 10 * share}


def text_of(columns, separator, mark, unit, order):
    # Spaces in a name are cells where spaces separate.
    emg = "EMG_µV" if separator.isspace() and separator != "\t" else "EMG µV"
    names = [*(f"{name}_{'s' if name == 'time' else unit}" if name in ("time", "x", "y", "z") else name for name in order), emg]
    values = [columns[name] * (UNITS[unit] if name in ("x", "y", "z") else 1) for name in [*order, "EMG µV"]]
    rows = [separator.join(f"{value:.9f}".replace(".", mark) for value in row) for row in zip(*values)]
    return "\n".join([separator.join(names), *rows]) + "\n"


def plain(path):
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    head, *rows = csv.reader(lines)
    return head, np.array([[float(cell) if cell else np.nan for cell in row] for row in rows])


def outcome(masseter, path, folder):
    """The plain form of a file; none where it is refused."""
    out = folder / "plain.csv"
    out.unlink(missing_ok=True)
    found = subprocess.run([masseter, "motion", path, "--format", "json", "--write", out], capture_output=True, text=True)
    if found.returncode not in (0, 1):
        assert found.stderr.strip(), path
        return None, found.stderr
    if json.loads(found.stdout)["refused"]:
        return None, json.loads(found.stdout)["refused"]
    return plain(out), ""


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("masseter")
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--every", type=int, default=1)
    arguments.add_argument("--cases", type=Path)
    args = arguments.parse_args()
    columns = motion()
    truth = np.column_stack([columns[name] for name in [*ORDERS["plain"], "EMG µV"]])
    counts = {"read": 0, "refused rightly": 0, "wrong": 0}
    path = args.folder / "messy.csv"
    combinations = itertools.product(SEPARATORS, MARKS, ENCODINGS, UNITS, ORDERS)
    for separator, mark, encoding, unit, order in itertools.islice(combinations, 0, None, args.every):
        path.write_bytes(text_of(columns, separator, mark, unit, ORDERS[order]).encode(encoding))
        found, reason = outcome(args.masseter, path, args.folder)
        is_readable = separator != mark
        if found is None:
            verdict = "wrong" if is_readable else "refused rightly"
        else:
            is_same = found[1].shape == truth.shape and np.abs(found[1] - truth).max() < TOLERANCE
            verdict = "read" if is_readable and is_same else "wrong"
        counts[verdict] += 1
        if verdict == "wrong":
            print("wrong:", repr((separator, mark, encoding, unit, order)), reason or found)
    for case in sorted(args.cases.iterdir()) if args.cases else []:
        found, reason = outcome(args.masseter, case, args.folder)
        print(f"{case.name}: {f'{len(found[1])} rows' if found else 'refused: ' + ' '.join(reason.split())[-240:]}")
    print("messy files:", ", ".join(f"{count} {verdict}" for verdict, count in counts.items()))
    assert counts["wrong"] == 0 and counts["read"] and counts["refused rightly"]


main()
