"""Reads the tables that `masseter export` makes of a recording, with polars and DuckDB.

    tests/foreign/read_tables.py MASSETER RUN_FOLDER FOLDER

Compares values with the recording, read by Python's `mcap`, and the formats and the programs with each other.
"""

import json
import subprocess
import sys
from pathlib import Path

import duckdb
import polars as pl
from mcap_ros2.reader import read_ros2_messages

masseter, run, folder = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
for kind in ("parquet", "csv"):
    words = [masseter, "export", run, "--format", kind, "--out", folder / kind]
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL)
names = {path.stem for path in (folder / "parquet").glob("*.parquet")}
assert names == {"cycles", "jaw_cycles", "command", "reading", "state", "truth", "frame", "event", "parameter"}, names

# The recording, as another reader sees it.
readings = [message.ros_msg for message in read_ros2_messages(str(run / "recording.mcap"), topics=["reading"])]
states = [message.ros_msg for message in read_ros2_messages(str(run / "recording.mcap"), topics=["state"])]
reading = pl.read_parquet(folder / "parquet" / "reading.parquet")
assert reading["cycle"].to_list() == [message.cycle for message in readings]
for axis in range(6):
    assert reading[f"position_m_{axis}"].to_list() == [message.position_m[axis] for message in readings]
running = next(state for state in states if state.controller_state == 3)
times = [(message.sampled_ns - running.sampled_ns) / 1e9 for message in readings]
assert reading["time_s"].to_list() == times

# The two programs, and the two formats.
for name in sorted(names):
    rows = pl.read_parquet(folder / "parquet" / f"{name}.parquet")
    as_csv = pl.read_csv(folder / "csv" / f"{name}.csv", schema=rows.schema)
    if name == "frame":
        # CSV does not distinguish a frame without data from a missing value.
        as_csv = as_csv.with_columns(pl.col("data").fill_null(""))
    assert rows.equals(as_csv), name
    counted = duckdb.sql(f"SELECT count(*) FROM '{folder}/parquet/{name}.parquet'").fetchall()[0][0]
    assert counted == len(rows) > 0, (name, counted)

# Units and meanings of the file are those of the codebook.
codebook = pl.read_csv(folder / "parquet" / "codebook.csv")
assert duckdb.sql(f"SELECT count(DISTINCT meaning) FROM '{folder}/csv/codebook.csv'").fetchall()[0][0] > 100
for name in names:
    metadata = pl.read_parquet_metadata(folder / "parquet" / f"{name}.parquet")
    described = codebook.filter(pl.col("table") == name)
    units = dict(zip(described["column"], described["unit"].fill_null("")))
    assert json.loads(metadata["units"]) == units, name
    assert json.loads(metadata["columns"]) == dict(zip(described["column"], described["meaning"])), name
    assert list(units) == pl.read_parquet_schema(folder / "parquet" / f"{name}.parquet").names(), name

# What a researcher asks: the opening of the jaw, and the largest bite force, while the motion runs.
opening, force = duckdb.sql(
    f"""SELECT max(jaw_opening_mm), max(bite_force_n) FROM '{folder}/parquet/cycles.parquet'
        WHERE controller_state = 'running' AND time_s BETWEEN 0 AND 10"""
).fetchall()[0]
assert 5.0 < opening < 60.0, opening
truth = pl.read_parquet(folder / "parquet" / "truth.parquet").select("cycle", "position_m_0", "joint_m_0")
joined = pl.read_parquet(folder / "parquet" / "cycles.parquet").join(truth, on="cycle")
assert (joined["d1_true_position_mm"] / 1000 - joined["joint_m_0"]).abs().max() < 1e-15
print(f"{len(codebook)} columns in {len(names)} tables; largest opening {opening:.2f} mm, bite force {force} N")
