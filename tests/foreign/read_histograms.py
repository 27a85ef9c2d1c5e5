"""Reads a run's interval logs with Python's HdrHistogram and compares them with summary.json."""

import json
import pathlib
import sys

from hdrh.histogram import HdrHistogram
from hdrh.log import HistogramLogReader

folder = pathlib.Path(sys.argv[1])
for figures in json.loads((folder / "summary.json").read_text())["figures"]["intervals"]:
    path = folder / "hist" / (figures["name"].replace(" ", "-") + ".hlog")
    total = HdrHistogram(1, 24 * 3600 * 10**9, 3)
    reader = HistogramLogReader(str(path), total)
    while (interval := reader.get_next_interval_histogram()) is not None:
        total.add(interval)
    assert total.get_total_count() == figures["n"], (path, total.get_total_count(), figures["n"])
    for percentile, key in ((50, "p50_ns"), (99, "p99_ns")):
        found, expected = total.get_value_at_percentile(percentile), figures[key]
        assert abs(found - expected) <= max(2, expected * 2e-3), (path, percentile, found, expected)
    print(f"{figures['name']:20} {figures['n']:8}")
