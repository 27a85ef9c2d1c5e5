"""Error, stated uncertainty and coverage of the estimated bite force in a campaign, as the table of docs/dynamics-control.md.

    bite_table.py FOLDER [LEAST]

The folder is that of a campaign of examples/campaign/bite_force.toml with `cases.parquet`. Fails where the uncertainty covers a
smaller share of the cycles than LEAST.
"""

import pathlib
import sys

import duckdb

LAW, FOOD, RANGE = '"dynamics.friction.model"', '"stimulus.bite.food.kind"', '"load_cell.range_n"'
GROUPS = {
    "all": "true",
    "robots `smooth`": f"{LAW} = 'smooth'",
    "robots `lugre`": f"{LAW} = 'lugre'",
    "soft food": f"{FOOD} = 'soft'",
    "peanut": f"{FOOD} = 'peanut'",
    "gum": f"{FOOD} = 'gum'",
}
ESTIMATES = {
    "drives": "force_estimate LIKE '%calibration_s = 0.0%'",
    "calibrated": "force_estimate LIKE '%calibration_s = 2.0%' AND force_estimate NOT LIKE '%load_cell%'",
    "load cell of 100 N": f"force_estimate LIKE '%load_cell%' AND {RANGE} = 100",
    "load cell of 1000 N": f"force_estimate LIKE '%load_cell%' AND {RANGE} = 1000",
}
# Heading, value and decimals.
COLUMNS = [
    ("runs", "count(bite_covered)", 0),
    ("error rms, N", "sqrt(avg(bite_error_rms_n ** 2))", 1),
    ("median error, N", "median(bite_error_median_n)", 1),
    ("median uncertainty, N", "median(bite_uncertainty_median_n)", 1),
    ("uncertainty by error", "median(bite_uncertainty_median_n) / median(bite_error_median_n)", 1),
    ("95 % of the errors by median", "median(bite_error_95_n) / median(bite_error_median_n)", 1),
    ("cycles covered, %", "100 * avg(bite_covered)", 1),
    ("without estimate, %", "100 * avg(bite_missing)", 0),
    ("phantom, N", "median(bite_phantom_n)", 1),
    ("largest phantom, N", "max(bite_phantom_n)", 1),
]


def main() -> None:
    table, least = pathlib.Path(sys.argv[1], "cases.parquet"), float(sys.argv[2]) if len(sys.argv) > 2 else 0.0
    values = ", ".join(value for _, value, _ in COLUMNS)
    print("| robots | estimate | " + " | ".join(heading for heading, _, _ in COLUMNS) + " |")
    print("| --- | --- |" + " ---: |" * len(COLUMNS))
    for name, group in GROUPS.items():
        for estimate, kind in ESTIMATES.items():
            row = duckdb.sql(f"SELECT {values} FROM '{table}' WHERE {group} AND {kind}").fetchall()[0]
            cells = ["–" if value is None else f"{value:.{decimals}f}" for value, (_, _, decimals) in zip(row, COLUMNS, strict=True)]
            print(f"| {name} | {estimate} | " + " | ".join(cells) + " |")
    covered, runs = duckdb.sql(f"SELECT avg(bite_covered), count(bite_covered) FROM '{table}'").fetchall()[0]
    if not runs or covered < least:
        sys.exit(f"{table}: {runs} runs with an estimate, whose uncertainty covers {covered}; demanded {least}")


main()
