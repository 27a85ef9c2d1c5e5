#!/usr/bin/env python3
"""What the default run says on this machine: as the present user and as an ordinary one, idle and beside four busy
processes.

    tests/realtime/verdicts.py target/release/masseter --runs 20

Prints a table: clock chosen, verdict, timing, exit code, and how many of the runs. Fails if a run that was judged ends with
another code than 0, or an ordinary user's run with another than 0. The ordinary user's rows need root. Only the Python
standard library is used.
"""

import argparse
import collections
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BUSY = 4
ORDINARY = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", "--no-new-privs"]
CLOCK = re.compile(r"\((\w+) clock\)")


def run_once(masseter, prefix):
    """Returns clock, verdict, timing, exit code, and the share of lost cycles in per cent."""
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o777)
        run = Path(folder) / "run"
        environment = {"PATH": os.environ["PATH"], "HOME": folder}
        ended = subprocess.run(
            [*prefix, masseter, "run", "--out", run], env=environment, cwd=folder, capture_output=True, text=True, timeout=120
        )
        if not (run / "summary.json").exists():
            raise SystemExit(f"the run left no summary: {ended.stderr}")
        verdict = json.loads((run / "summary.json").read_text())["verdict"]
        timing = verdict["timing"]
        lost_percent = 100 * timing["lost"] / max(timing["cycles"], 1)
        clock = CLOCK.search(ended.stdout)[1]
        return (clock, verdict["word"], timing["word"], ended.returncode), lost_percent


def table_of(masseter, runs):
    users = [("root" if os.geteuid() == 0 else "this user", [])]
    if os.geteuid() == 0:
        users.append(("ordinary", ORDINARY))
    else:
        print("the ordinary user's rows are left out: they need root", file=sys.stderr)
    wrong = []
    print("| user | machine | clock | verdict | timing | exit code | runs | cycles lost, median (most) |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name, prefix in users:
        is_ordinary = bool(prefix) or os.geteuid() != 0
        for machine, count in (("idle", 0), (f"{BUSY} busy processes", BUSY)):
            busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
            time.sleep(1)
            outcomes = collections.defaultdict(list)
            try:
                for _ in range(runs):
                    outcome, lost_percent = run_once(masseter, prefix)
                    outcomes[outcome].append(lost_percent)
            finally:
                for process in busy:
                    process.kill()
                    process.wait()
            for (clock, word, timing, code), lost in sorted(outcomes.items()):
                print(
                    f"| {name} | {machine} | {clock} | {word} | {timing} | {code} | {len(lost)} "
                    f"| {statistics.median(lost):.2f} % ({max(lost):.2f} %) |",
                    flush=True,
                )
                if code != 0 and (is_ordinary or word != "INVALID"):
                    wrong.append((name, machine, word, code))
    return wrong


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("masseter", type=os.path.abspath)
parser.add_argument("--runs", type=int, default=20, help="runs of each row")
arguments = parser.parse_args()
wrong = table_of(arguments.masseter, arguments.runs)
sys.exit(f"unexpected: {wrong}" if wrong else 0)
