#!/usr/bin/env python3
"""Rigs under attack that are interrupted, or lose a process, at random moments: the exit code is the documented one, the end
comes as soon as without an attack, an honest browser is served, and nothing stays.

    tests/realtime/attacked.py target/release/masseter --times 300

Every second rig waits for a program as its controller. The attackers connect to every socket of the rig and to its live
page, as a user of the machine without the secret can: bytes that drip, silence, reconnections, wrong greetings, floods.
Only the Python standard library is used.
"""

import argparse
import collections
import contextlib
import os
import random
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path

from rig import END_S, LENIENT, Again, children_of, clean, inside, left_of, wait_for_end

HITS = [("supervisor", signal.SIGINT), ("supervisor", signal.SIGTERM), ("supervisor", signal.SIGKILL)]
HITS += [(role, signal.SIGKILL) for role in ("controller", "plant", "recorder")]
INTERRUPTED, DIED, INVALID = 130, 4, 3
# Time from the hit to the end of all processes, beyond the slowest rig of the same hit without an attack, s.
MOST_MORE_S = 1.0
# Time to a page beyond the slowest one alone, s.
PAGE_S = 1.0
ATTACKERS = 4
# Connections of each kind and attacker that stay open.
HELD = 200


def peer_of(target):
    """A connection to a path, or to a port of this machine."""
    family = socket.AF_UNIX if isinstance(target, Path) else socket.AF_INET
    peer = socket.socket(family)
    peer.settimeout(0.5)
    peer.connect(str(target) if isinstance(target, Path) else ("127.0.0.1", target))
    return peer


def strike(target, dripping, silent, chance):
    """One hostile act at a socket. A refusal is what the rig is for."""
    act = chance.choice(["drip", "silent", "reconnect", "refused", "flood", "request"])
    with contextlib.suppress(OSError):
        peer = peer_of(target)
        words = {"refused": b"hello\n", "flood": b"x" * 65_536, "request": b"GET / HTTP/1.1\r\nHost: x\r\n"}
        if act in words:
            peer.sendall(words[act])
        if act == "drip":
            dripping.append(peer)
        elif act != "reconnect":
            silent.append(peer)
    for peer in list(dripping):
        try:
            peer.send(b"x", socket.MSG_DONTWAIT)
        except OSError:
            # The rig has refused this one.
            dripping.remove(peer)
            peer.close()
    for peers in (dripping, silent):
        if len(peers) > HELD:
            peers.pop(0).close()


@contextlib.contextmanager
def attack(targets, seed):
    """Attacks all targets from threads until the end of the block."""
    is_over = threading.Event()

    def work(number):
        chance, dripping, silent = random.Random(f"{seed}-{number}"), [], []
        while not is_over.is_set():
            for target in targets:
                strike(target, dripping, silent, chance)
            time.sleep(0.003)

    threads = [threading.Thread(target=work, args=(number,)) for number in range(ATTACKERS if targets else 0)]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        is_over.set()
        for thread in threads:
            thread.join()


class Trial:
    """A rig of its own with a live page; every second one has a program as its controller."""

    def __init__(self, masseter, clock, folder, number, ending):
        self.masseter, self.name, self.said = masseter, f"attacked-{os.getpid()}-{number}", Path(folder) / "said"
        self.runtime, self.controller, self.ending = Path(folder) / "runtime", None, ending
        self.runtime.mkdir(mode=0o700)
        words = ["run", LENIENT, "--clock", clock, "--duration", "60s", "--name", self.name, "--out", Path(folder) / "run"]
        is_external = number % 2 == 1
        words += ["--live=127.0.0.1:0", "--controller", "external" if is_external else "motion"]
        with self.said.open("w") as said:
            self.rig = self.start(words, said)
        self.wait_for(self.sockets, "sockets")
        if is_external:
            self.controller = self.start(["controller", "--rig", self.name], subprocess.DEVNULL)
        self.wait_for(self.address, "an address of its live page")
        recording = Path(folder) / "run" / "recording.mcap"
        self.wait_for(lambda: recording.exists() and recording.stat().st_size > 100_000, "a recording")

    def start(self, words, said):
        process = subprocess.Popen(
            [self.masseter, *words], env=inside(self.runtime), stdin=subprocess.DEVNULL, stdout=said, stderr=said
        )
        # Whatever happens to the trial, nothing of it stays.
        self.ending.callback(process.wait)
        self.ending.callback(process.kill)
        return process

    def wait_for(self, what, name):
        deadline = time.monotonic() + END_S
        while not what():
            self.require_running()
            if time.monotonic() > deadline:
                raise SystemExit(f"the rig has no {name}: {self.said.read_text()}")
            time.sleep(0.005)

    def require_running(self):
        """The machine may end a rig in real time; nothing else may."""
        if self.rig.poll() is None:
            return
        if self.rig.returncode == INVALID:
            raise Again
        raise SystemExit(f"the rig ended by itself with {self.rig.returncode}: {self.said.read_text()}")

    def sockets(self):
        return [path for path in self.runtime.rglob("*") if path.is_socket()]

    def address(self):
        found = re.search(r"http://127\.0\.0\.1:\d+/\S*", self.said.read_text())
        return found and found.group()

    def targets(self):
        return [*self.sockets(), int(self.address().split(":")[2].split("/")[0])]

    def served_s(self):
        """The time in which an honest browser has the live page, s."""
        began = time.monotonic()
        try:
            with urllib.request.urlopen(self.address(), timeout=END_S) as page:
                is_page = b"<html" in page.read()
        except OSError as error:
            # A rig that ends by itself closes its page first.
            time.sleep(2.0)
            self.require_running()
            raise SystemExit(f"no live page: {error}: {self.said.read_text()}") from error
        if not is_page:
            raise SystemExit("the live page is no page")
        return time.monotonic() - began

    def hit(self, role, how):
        """Hits a process: the exit code of the rig, and the time until all of its processes are over, s."""
        children = children_of(self.rig)
        if self.controller:
            children["controller"] = self.controller.pid
        self.require_running()
        os.kill(self.rig.pid if role == "supervisor" else children[role], how)
        over_s = wait_for_end(self.rig, children.values(), f"{role} hit by {how.name}: {self.said.read_text()}")
        return self.rig.returncode, over_s


def run_once(masseter, clock, hit, number, seed, is_attacked):
    """One rig and one hit: the time to its end and the time of an honest browser, s."""
    role, how = hit
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as ending:
        chance, trial = random.Random(seed), Trial(masseter, clock, folder, number, ending)
        with attack(trial.targets() if is_attacked else [], seed):
            time.sleep(chance.uniform(0.0, 1.5))
            page_s = trial.served_s()
            code, over_s = trial.hit(role, how)
        what = f"{role} hit by {how.name}"
        expected = DIED if role != "supervisor" else -signal.SIGKILL if how == signal.SIGKILL else INTERRUPTED
        if code != expected:
            raise SystemExit(f"{what}: exit code {code} instead of {expected}: {trial.said.read_text()}")
        if code == -signal.SIGKILL:
            # Nobody is left who could remove anything.
            clean(masseter, trial.runtime)
        if left := left_of(trial.name, trial.runtime):
            raise SystemExit(f"{what}: {left} stayed")
        return over_s, page_s


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--times", type=int, default=300)
    parser.add_argument("--clock", choices=["rt", "lockstep"], default="rt")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    masseter, numbers = arguments.masseter.resolve(), iter(range(10**9))

    repeated = {False: 0, True: 0}

    def once(hit, is_attacked):
        for _ in range(10):
            number = next(numbers)
            seed = f"{arguments.seed}-{number}"
            try:
                return run_once(masseter, arguments.clock, hit, number, seed, is_attacked)
            except Again:
                repeated[is_attacked] += 1
        raise SystemExit("the machine is too disturbed: ten rigs in turn ended by themselves")

    alone = {hit: [once(hit, False) for _ in range(1 if arguments.times <= len(HITS) else 2)] for hit in HITS}
    alone_s = {hit: max(over_s for over_s, _ in measured) for hit, measured in alone.items()}
    page_alone_s = max(page_s for measured in alone.values() for _, page_s in measured)
    over_s, pages_s = collections.defaultdict(list), []
    for count in range(arguments.times):
        # Both kinds of controllers meet every hit, one in the first round and the other one in the next.
        hit = HITS[(count + count // len(HITS)) % len(HITS)]
        taken_s, page_s = once(hit, True)
        over_s[hit].append(taken_s)
        pages_s.append(page_s)
    late = []
    for hit, times_s in over_s.items():
        role, how = hit
        print(f"{role:<10} {how.name:<7} × {len(times_s):>3}: over after {max(times_s):.2f} s, alone {alone_s[hit]:.2f} s")
        if max(times_s) > alone_s[hit] + MOST_MORE_S:
            late.append(f"{role} hit by {how.name}: {max(times_s):.2f} s, alone {alone_s[hit]:.2f} s")
    print(f"an honest browser has its page after {max(pages_s):.2f} s, alone {page_alone_s:.2f} s")
    if max(pages_s) > page_alone_s + PAGE_S:
        late.append(f"an honest browser waits {max(pages_s):.2f} s for its page")
    print(f"rigs that the machine ended: {repeated[True]} under attack, {repeated[False]} alone")
    # Attacks end no rig: what the machine ends comes as often alone.
    if repeated[True] > 2 + 0.1 * arguments.times + arguments.times * repeated[False] / (2 * len(HITS)):
        late.append(f"under attack {repeated[True]} rigs ended by themselves")
    if late:
        sys.exit("\n".join(late))


if __name__ == "__main__":
    main()
