"""Reads the results of a campaign with polars and DuckDB, and kills what runs it. Every case must have one result, whatever
dies: the campaign itself, a case, or a whole HyperQueue cluster; and so after interrupts, which leave no case behind. In the package
from PyPI, the workers of a cluster are threads of its server, so a worker cannot be killed alone here.

    campaign.py MASSETER FOLDER
"""

import collections
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import time

import duckdb
import polars

program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "examples/campaign/on_hyperqueue.py"
folder.mkdir()
(folder / "chewing.toml").write_text(
    "duration_s = 1.0\n[[require]]\nname = 'incisal'\nsignal = 'incisal.error'\nduring = 'running'\nmax = '60 um'\n"
)
CASES = 40
RECORDED = 3
KILLS = 4
PASSED = {"PASS"}.__contains__
JUDGED = {"PASS", "FAIL", "SAFE STOP", "DIED"}.__contains__
(folder / "friction.toml").write_text(
    f"""scenario = "chewing.toml"
sampler = "latin-hypercube"
runs = {CASES}

[[factor]]
key = "dynamics.slide_friction_n"
range = [2.0, 30.0]

[[factor]]
key = "motion"
values = [{{ kind = "chewing" }}, {{ kind = "opening" }}]

[[factor]]
faults = ["none", {{ kind = "encoder_noise", axis = "l2", size = "20 um", at_s = 0.2 }}]
"""
)

CLUSTER = """
import sys, time
from hyperqueue.cluster import LocalCluster, WorkerConfig
cluster = LocalCluster(sys.argv[1])
cluster.start_worker(WorkerConfig(cores=1))
cluster.start_worker(WorkerConfig(cores=1))
print("ready", flush=True)
time.sleep(600)
"""

# Returns when every task of a job has ended.
AWAIT_JOB = """
import sys
from hyperqueue import Client
Client(sys.argv[1]).connection.wait_for_jobs([int(sys.argv[2])], lambda status: None)
"""


def command(out):
    return [program, "campaign", "friction.toml", "--out", out, "--record", str(RECORDED)]


def on_hyperqueue(out, server):
    more = ["--masseter", program, "--server-dir", server, "--", "--record", str(RECORDED)]
    return [sys.executable, SCRIPT, "friction.toml", out, *more]


def start(out, server=None):
    """The campaign on this machine, or on the workers of a server."""
    return subprocess.Popen(
        command(out) if server is None else on_hyperqueue(out, server),
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def results(out):
    return [json.loads(path.read_text()) for path in (folder / out / "cases").glob("*/result.json")]


def rows(out):
    """The table without the times that its cases took."""
    return polars.read_parquet(folder / out / "cases.parquet").drop("took_s").sort("case")


def cases_alive():
    """The processes that run single cases of this campaign."""
    listed = subprocess.run(["pgrep", "-f", f"campaign-case {folder}"], stdout=subprocess.PIPE, text=True)
    return [int(process) for process in listed.stdout.split()]


def kill_a_case():
    """Whether a case was alive for its kill."""
    for process in cases_alive():
        try:
            os.kill(process, signal.SIGKILL)
            return True
        except ProcessLookupError:
            pass
    return False


def wait_until(what, is_so, for_s=60.0):
    give_up = time.monotonic() + for_s
    while not is_so():
        assert time.monotonic() < give_up, what
        time.sleep(0.02)


def check_complete(out):
    assert len(results(out)) == CASES, out
    assert not list((folder / out / "attempts").iterdir()), out
    assert rows(out)["case"].to_list() == list(range(CASES)), out
    assert rows(out).equals(rows("whole")), out
    assert len(list((folder / out / "worst").glob("*/report.html"))) == RECORDED, out
    assert not list((folder / out / "worst").glob("*.part")), out


def kill_it(campaign):
    """A kill that comes too late would prove nothing."""
    campaign.kill()
    campaign.communicate()
    assert campaign.returncode == -signal.SIGKILL, "the campaign ended before its kill"


# A whole campaign, read by two programs.
began = time.monotonic()
done = start("whole")
said, _ = done.communicate()
lasted_s = time.monotonic() - began
assert done.returncode == 1 and said.startswith(f"FAIL: {CASES} cases of {CASES}"), said
table = polars.read_parquet(folder / "whole/cases.parquet")
assert table.height == CASES and table["dynamics.slide_friction_n"].dtype == polars.Float64
assert set(table["motion"]) == {"chewing", "opening"} and set(table["fault"]) == {"none", "encoder_noise"}
by_id = {result["id"]: result for result in results("whole")}
for row in table.iter_rows(named=True):
    (check,) = (check for check in by_id[row["id"]]["checks"] if check["name"] == "incisal")
    assert row["incisal.margin"] == check["margin"] and row["verdict"] == by_id[row["id"]]["word"], row
metadata = duckdb.sql(f"select key, value from parquet_kv_metadata('{folder}/whole/cases.parquet')").fetchall()
units = json.loads(dict(metadata)[b"units"])
assert units["dynamics.slide_friction_n"] == "N" and units["incisal.margin"] == "mm", units
counted = duckdb.sql(f"select verdict, count(*) from '{folder}/whole/cases.parquet' group by verdict").fetchall()
assert dict(counted) == collections.Counter(result["word"] for result in results("whole")), counted

# The page has a command for each of the worst cases, which gives the same run again.
page = (folder / "whole/campaign.html").read_text()
scenarios = sorted((folder / "whole/worst").glob("*.toml"))
passed, judged = (sum(test(result["word"]) for result in results("whole")) for test in (PASSED, JUDGED))
for name, value in (("success rate", f"{100 * passed / judged:.1f} %"), ("judged", judged)):
    assert f'["{name}","{value}"]' in page, (name, value)
assert len(scenarios) == RECORDED
for scenario in scenarios:
    again = f"masseter run {scenario.relative_to(folder)} --clock virtual"
    assert again in page, again
    out = folder / f"again-{scenario.stem}"
    subprocess.run([program, *again.split()[1:], "--quiet", "--out", out], cwd=folder, stdout=subprocess.PIPE)
    digest = json.loads((out / "summary.json").read_text())["figures"]["digest"]
    assert digest == by_id[scenario.stem.rsplit("-", 1)[1]]["digest"], scenario

# An ended campaign runs nothing again.
times = lambda: {path: path.stat().st_mtime_ns for path in (folder / "whole/cases").glob("*/result.json")}
before = times()
start("whole").communicate()
assert times() == before

# The campaign is killed at moments of its life, then while it records, and goes on. All the moments fit into one life.
moments = random.Random(1)
for _ in range(KILLS):
    killed = start("killed")
    time.sleep(moments.uniform(0.05, 0.5 / KILLS) * lasted_s)
    kill_it(killed)
assert len(results("killed")) < CASES
killed = start("killed")
wait_until("a case is recorded", lambda: list((folder / "killed/worst").glob("*.part")))
kill_it(killed)
start("killed").communicate()
check_complete("killed")

# A case is killed and runs again. Then the cluster is killed with its server and workers, and a new cluster goes on.
server = folder / "server"


def cluster():
    started = subprocess.Popen([sys.executable, "-c", CLUSTER, server], stdout=subprocess.PIPE, text=True)
    while (line := started.stdout.readline()) != "ready\n":
        assert line, "the cluster does not start"
    return started


first = cluster()
campaign = start("case", server)
wait_until("a case dies", kill_a_case)
_, said = campaign.communicate()
assert campaign.returncode == 1 and "\n1 cases to HyperQueue" in said, (campaign.returncode, said)
# What the killed case left goes with the next start of the command.
start("case", server).communicate()
check_complete("case")
campaign = start("cluster", server)
wait_until("some cases have ended", lambda: (folder / "cluster/cases").is_dir() and len(results("cluster")) > 5)
first.kill()
first.wait()
wait_until("no case outlives its worker", lambda: not cases_alive(), 5.0)
_, said = campaign.communicate()
assert campaign.returncode == 4 and "the same command goes on" in said, (campaign.returncode, said)
assert len(results("cluster")) < CASES
second = cluster()
campaign = start("cluster", server)
said = campaign.communicate()
second.kill()
assert campaign.returncode == 1, said
check_complete("cluster")

# An interrupt stops the cases at the workers too. The same command runs what is left, at once or once the old job has ended.
server = folder / "another"
third = cluster()
for signalled in (signal.SIGINT, signal.SIGTERM):
    before = len(results("interrupted"))
    campaign = start("interrupted", server)
    wait_until("some cases have ended", lambda: len(results("interrupted")) > before + 5)
    campaign.send_signal(signalled)
    _, said = campaign.communicate()
    assert campaign.returncode == 130 and "start no others; 'hq job cancel " in said, (campaign.returncode, said)
    if signalled == signal.SIGTERM:
        job = int(said.split("hq job cancel ")[1].split("'")[0])
        subprocess.run([sys.executable, "-c", AWAIT_JOB, server, str(job)], check=True, timeout=30.0)
        wait_until("no case outlives its job", lambda: not cases_alive(), 5.0)
    assert before < len(results("interrupted")) < CASES
campaign = start("interrupted", server)
said = campaign.communicate()
third.kill()
assert campaign.returncode == 1, said
check_complete("interrupted")
print(f"{CASES} cases: read by two programs, and each with one result after every kill")
