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
        # The two libraries round the rank of a percentile differently: one sample more or less, which lie apart
        # where samples are few.
        below, above = (total.get_value_at_percentile(percentile + 100 * ranks / figures["n"]) for ranks in (-1, 1))
        expected, unit = figures[key], max(2, figures[key] * 2e-3)
        assert below - unit <= expected <= above + unit, (path, percentile, below, expected, above)
    print(f"{figures['name']:20} {figures['n']:8}")
