"""Figures of docs/realtime.md that only developers measure. Each bench calls the program and reads what its runs leave.

    python3 scripts/bench.py loop MASSETER         # wake-ups of the loops at 1 kHz, beside those of cyclictest, where installed
    python3 scripts/bench.py rate MASSETER         # the whole rig in real time at 1 to 20 kHz, on wires without delays
    python3 scripts/bench.py simulated MASSETER    # whole runs in lockstep and under virtual time, per cycle
    python3 scripts/bench.py virtual MASSETER      # the default motion of 10 s without a recording, by CPU time and memory

Candidates take turns, round by round, and the first one of a round changes. Figures are median (least–most) of the rounds. The
exit code is 3 if the machine stalled for more than 1 % of the time observed, or its host stole more than 1 % of the cores' time:
such figures come from the machine.
"""

import argparse
import json
import os
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RATES_HZ = [1000, 2000, 5000, 10_000, 20_000]
INTERVALS = ["controller wake-up", "controller cycle", "round trip"]
PROCESSES = ["controller", "plant", "recorder"]
OBSERVED_NS, STALL_NS = 50_000_000, 20_000
BOUND_PERCENT = 1.0
PRIORITY = 80
DISTURBED = 3


class Stillness:
    """The time that the machine took: stolen by its host, or standing still before a round."""

    def __init__(self):
        self.began, self.stolen_s = time.monotonic(), self.stolen()
        self.observed_ns = self.stalled_ns = 0

    @staticmethod
    def stolen():
        return int(Path("/proc/stat").read_text().split()[8]) / os.sysconf("SC_CLK_TCK")

    def observe(self):
        """Spins with the priority of the rig, where the kernel grants it, so that other programs do not count."""
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except PermissionError:
            pass
        before = began = time.perf_counter_ns()
        while before < began + OBSERVED_NS:
            now = time.perf_counter_ns()
            self.stalled_ns += now - before if now - before > STALL_NS else 0
            before = now
        self.observed_ns += before - began
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))

    def exit_code(self):
        stolen = 100 * (self.stolen() - self.stolen_s) / (time.monotonic() - self.began) / os.cpu_count()
        stalled = 100 * self.stalled_ns / self.observed_ns
        is_disturbed = max(stolen, stalled) > BOUND_PERCENT
        print(f"{'INVALID: ' * is_disturbed}the machine stalled for {stalled:.1f} %, its host stole {stolen:.1f} %")
        return DISTURBED if is_disturbed else 0


def take_turns(candidates, rounds, measure):
    """The measurements of each candidate."""
    measured = {candidate: [] for candidate in candidates}
    stillness = Stillness()
    for number in range(rounds):
        for place in range(len(candidates)):
            candidate = candidates[(number + place) % len(candidates)]
            stillness.observe()
            measured[candidate].append(measure(candidate))
    return measured, stillness


def spread(values, digits=3):
    if not values:
        return "not measured"
    median, least, most = statistics.median(values), min(values), max(values)
    return f"{median:.{digits}g} ({least:.{digits}g}–{most:.{digits}g})"


def play(masseter, scenario, clock):
    """Plays a scenario; returns exit code, summary and manifest."""
    with tempfile.TemporaryDirectory() as folder:
        file, out = Path(folder, "scenario.toml"), Path(folder, "run")
        file.write_text(scenario)
        run = [masseter, "run", "--clock", clock, "--quiet", "--format", "json", "--out", out, file]
        code = subprocess.run(run, stdout=subprocess.DEVNULL).returncode
        return code, *(json.loads((out / name).read_text()) for name in ("summary.json", "manifest.json"))


def cyclictest(options, core):
    """p50 and p99 in µs of a thread that wakes as often as the rig's loops; latencies above 20 ms count as 20 ms."""
    run = ["cyclictest", *options, "--quiet", "--mlockall", "--threads=1", "--interval=1000", f"--priority={PRIORITY}",
           f"--affinity={core}", "--loops=5000", "--histogram=20000"]
    told = subprocess.run(run, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    counts = [tuple(map(int, line.split())) for line in told if line and line[0].isdigit()]
    above = next(int(line.split(":")[1]) for line in told if line.startswith("# Histogram Overflows"))
    latest = [us for us, count in [*counts, (20_000, above)] for _ in range(count)]
    return [latest[len(latest) * share // 100] for share in (50, 99)]


def loop(masseter, rounds, cores):
    def rig(latency):
        scenario = f"name = 'loop'\nduration_s = 5.0\n[realtime]\ncores = {cores}\ncpu_dma_latency = '{latency}'\n"
        _, summary, _ = play(masseter, scenario, "rt")
        found = next(each for each in summary["figures"]["intervals"] if each["name"] == "controller wake-up")
        return [found[key] / 1000 for key in ("p50_ns", "p99_ns")]

    candidates = {
        "masseter": lambda: rig("leave"),
        "masseter, /dev/cpu_dma_latency held": lambda: rig("hold"),
        "cyclictest --laptop": lambda: cyclictest(["--laptop"], cores[0]),
        "cyclictest (holds it)": lambda: cyclictest([], cores[0]),
    }
    is_installed = shutil.which("cyclictest") is not None
    played = [name for name in candidates if is_installed or name.startswith("masseter")]
    measured, stillness = take_turns(played, rounds, lambda name: candidates[name]())
    for name, turns in measured.items():
        p50, p99 = zip(*turns)
        print(f"{name}: p50 {spread(p50)} µs, p99 {spread(p99)} µs")
    return stillness.exit_code()


def rate(masseter, rounds, cores):
    def run(rate_hz):
        silence = 20 * rate_hz // 1000
        scenario = (
            f"name = 'rate'\nrate_hz = {rate_hz}\nduration_s = 2.0\n[realtime]\ncores = {cores}\n"
            f"[can]\nideal = true\ncommand_timeout_cycles = {silence}\n[controller]\nstale_cycles = {silence}\n"
        )
        code, summary, manifest = play(masseter, scenario, "rt")
        return code, summary["figures"], manifest["usage"]["processes"]

    measured, stillness = take_turns(RATES_HZ, rounds, run)
    for rate_hz, runs in measured.items():
        played = [(figures, usage) for _, figures, usage in runs if figures["final_state"] == "finished"]
        missing = [sum(topic["missing"] for topic in figures["topics"]) for figures, _ in played]
        whole = [run for run, lost in zip(played, missing) if not lost]
        stalled = sum(code == DISTURBED and figures["final_state"] != "finished" for code, figures, _ in runs)
        print(f"{rate_hz} Hz: {len(whole)} of {rounds} runs count; {rounds - len(played)} did not reach their end, "
              f"{stalled} of these because the machine stalled; messages missing: {sum(missing)}")
        for name in INTERVALS:
            found = [next(each for each in figures["intervals"] if each["name"] == name) for figures, _ in whole]
            p50, p99 = ([each[key] / 1000 for each in found] for key in ("p50_ns", "p99_ns"))
            print(f"  {name}: p50 {spread(p50)} µs, p99 {spread(p99)} µs")
        for key in ("skipped", "by_machine"):
            shares = []
            for figures, _ in whole:
                skips = [figures[loop][key] for loop in ("controller_skips", "plant_skips")]
                skipped = sum(figures[loop]["skipped"] for loop in ("controller_skips", "plant_skips"))
                published = sum(t["messages"] for t in figures["topics"] if t["topic"] in ("state", "reading"))
                shares.append(100 * sum(skips) / (published + skipped))
            print(f"  deadlines {key}: {spread(shares)} %")
        for process in PROCESSES:
            used = [usage[process] for _, usage in whole if process in usage]
            print(f"  {process}: {spread([100 * each['cpu_s'] / each['observed_s'] for each in used])} % of a core")
    return stillness.exit_code()


def simulated(masseter, rounds, cores):
    def per_cycle_us(clock):
        began = time.perf_counter()
        scenario = f"name = 'simulated'\nduration_s = 30.0\n[realtime]\ncores = {cores}\n"
        code, summary, _ = play(masseter, scenario, clock)
        if code != 0:
            sys.exit(f"a run by --clock {clock} ended with {code} instead of 0")
        return 1e6 * (time.perf_counter() - began) / summary["figures"]["cycles"]

    measured, stillness = take_turns(["lockstep", "virtual"], rounds, per_cycle_us)
    for clock, taken in measured.items():
        print(f"{clock}: {spread(taken)} µs a cycle, {1000 / statistics.median(taken):.1f} times real time")
    ratios = [lockstep / virtual for lockstep, virtual in zip(*measured.values())]
    print(f"lockstep / virtual: {spread(ratios)}")
    return stillness.exit_code()


def virtual(masseter, rounds, cores):
    os.sched_setaffinity(0, {cores[0]})

    def run(file):
        before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run([masseter, "test", file], check=True, stdout=subprocess.DEVNULL)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return time.perf_counter() - began, cpu_s, after.ru_maxrss / 1000

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "chewing.toml")
        file.write_text("")
        measured, stillness = take_turns([file], rounds, run)
    wall_s, cpu_s, memory_mb = zip(*measured[file])
    for name, taken_s in (("wall time", wall_s), ("CPU time", cpu_s)):
        print(f"{name}: {spread([1000 * each for each in taken_s])} ms, {10 / statistics.median(taken_s):.1f} times real time")
    print(f"memory of the process: at most {max(memory_mb):.1f} MB")
    return stillness.exit_code()


def main():
    benches = {bench.__name__: bench for bench in (loop, rate, simulated, virtual)}
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("bench", choices=benches)
    arguments.add_argument("masseter")
    arguments.add_argument("--rounds", type=int, default=5)
    arguments.add_argument("--cores", type=lambda text: [int(core) for core in text.split(",")], default=[0, 1])
    given = arguments.parse_args()
    sys.exit(benches[given.bench](os.path.abspath(given.masseter), given.rounds, given.cores))


main()
