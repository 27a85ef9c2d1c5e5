"""Plays the cases of a campaign on the workers of a HyperQueue server, then reports. The same command goes on where one was killed.

    pip install hyperqueue                 # in the version of the server
    python3 on_hyperqueue.py friction.toml /shared/friction [--masseter FILE] [--server-dir DIR] [-- --record 3]

What follows `--` goes to `masseter campaign`. Exit codes are those of `masseter campaign`; 4 if HyperQueue does not answer.
"""

import argparse
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

ROUNDS = 3
DIED, INTERRUPTED = 4, 130


def submit(server, commands, number):
    """Submits a job and waits until it has ended. In a process of its own, since nothing interrupts this wait."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # A progress bar would be mixed with the messages.
    os.environ["TQDM_DISABLE"] = "1"
    try:
        from hyperqueue import Client, Job

        client, job = Client(server), Job(max_fails=None)
        for command in commands:
            job.program(command, stdout=None, stderr=None)
        submitted = client.submit(job)
        number.value = submitted.id
        client.wait_for_jobs([submitted], raise_on_error=False)
    except Exception as error:
        why = str(error).partition("\n")[0]
        sys.exit(f"HyperQueue does not answer: {why}; start its server and workers, and the same command goes on")


def play(campaign, out, server):
    """Submits what has no result, until everything has one."""
    # Queued cases of an interrupted start end when a worker takes them. Another start has another mark.
    mark = out / f"interrupted-{time.time_ns()}"
    for _ in range(ROUNDS):
        planned = subprocess.run([*campaign, "--plan"], stdout=subprocess.PIPE, text=True)
        if planned.returncode != 0:
            sys.exit(planned.returncode)
        cases = planned.stdout.split()
        if not cases:
            return
        print(f"{len(cases)} cases to HyperQueue", file=sys.stderr, flush=True)
        guard = ["sh", "-c", '[ -e "$0" ] || exec "$@"', mark, campaign[0], "campaign-case", out]
        number = multiprocessing.Value("i", 0)
        job = multiprocessing.Process(target=submit, args=(server, [[*map(str, guard), case] for case in cases], number))
        try:
            job.start()
            job.join()
        except KeyboardInterrupt:
            mark.touch()
            job.kill()
            print(f"workers end their cases and start no others; 'hq job cancel {number.value}' also empties the queue", file=sys.stderr)
            sys.exit(INTERRUPTED)
        if job.exitcode != 0:
            sys.exit(DIED)


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("file")
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--masseter", default="masseter")
    arguments.add_argument("--server-dir")
    own, more = sys.argv[1:], []
    if "--" in own:
        own, more = own[: own.index("--")], own[own.index("--") + 1 :]
    given = arguments.parse_args(own)
    # A worker has another folder.
    program, out = os.path.abspath(shutil.which(given.masseter) or given.masseter), given.out.absolute()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    campaign = [program, "campaign", given.file, "--out", out, *more]
    play(campaign, out, given.server_dir)
    # What three rounds left without a result runs here.
    sys.exit(subprocess.run(campaign).returncode)


if __name__ == "__main__":
    main()
