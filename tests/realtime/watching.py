#!/usr/bin/env python3
"""What being watched costs the loops: runs alone, with the progress on a terminal, with a WebSocket client that takes every
message, and with a page that takes its updates, in turn, again and again. The page is not drawn: a browser on this machine
would measure itself.

    tests/realtime/watching.py target/release/masseter --rounds 5 --seconds 12

Prints p50, p99, p99.9 and maximum of both loops' wake-up and of the controller's cycle: the median of the rounds, and
the least and the most of them. A run that the machine kept from its end is made again. Only the Python standard library
is used.
"""

import argparse
import json
import os
import pty
import random
import re
import socket
import statistics
import struct
import subprocess
import tempfile
import threading
import urllib.request
from pathlib import Path

CHANNELS = 9
TRIES = 5
INTERVALS = ("plant wake-up", "controller wake-up", "controller cycle")
# p99.9 needs 10,000 cycles.
QUANTILES = ("p50_ns", "p99_ns", "p999_ns", "max_ns")


def frame(text):
    """A WebSocket text frame of a client, masked with zeros."""
    data = text.encode()
    assert 126 <= len(data) < 1 << 16
    return struct.pack(">BBH4x", 0x81, 0xFE, len(data)) + data


def connect(url, path, protocol):
    """A WebSocket of this protocol."""
    address = url.split("/")[2]
    host, port = address.split(":")
    link = socket.create_connection((host, int(port)))
    link.sendall(
        f"GET {path} HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: {protocol}\r\n\r\n".encode()
    )
    answer = b""
    while b"\r\n\r\n" not in answer:
        answer += link.recv(1)
    return link


def count_bytes(link):
    total = 0
    while data := link.recv(1 << 20):
        total += len(data)
    return total


def take_everything(url):
    """Subscribes to every channel and reads all that comes; returns how many bytes came."""
    with connect(url, "/" + url.split("/")[3], "foxglove.sdk.v1") as link:
        wanted = [{"id": channel, "channelId": channel} for channel in range(CHANNELS)]
        link.sendall(frame(json.dumps({"op": "subscribe", "subscriptions": wanted})))
        return count_bytes(link)


def take_the_page(url):
    """Loads the page and takes its updates; returns how many bytes came."""
    path = "/" + url.split("/")[3]
    html = urllib.request.urlopen(url.replace("ws:", "http:")).read().decode()
    number = re.search(r'"number":(\d+)', html).group(1)
    with connect(url, f"{path}?after={number}", "masseter.page.v1") as link:
        return len(html) + count_bytes(link)


def alone(command):
    subprocess.run([*command, "--quiet"], stdout=subprocess.DEVNULL)


def terminal(command):
    """On a terminal of its own, which somebody reads."""
    process, screen = pty.fork()
    if process == 0:
        os.environ["TERM"] = "xterm"
        os.execv(command[0], command)
    try:
        while os.read(screen, 1 << 16):
            pass
    except OSError:  # The last process has closed it.
        pass
    os.waitpid(process, 0)


def watched(command, take):
    """With a client on the live view; returns how many bytes it took."""
    rig = subprocess.Popen(
        [*command, "--live=127.0.0.1:0"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    url = next(line.split()[2] for line in rig.stderr if line.startswith("live on "))
    taken = []
    watcher = threading.Thread(target=lambda: taken.append(take(url)))
    watcher.start()
    said = rig.stderr.read()
    rig.wait()
    watcher.join()
    assert "not shown live" not in said, said
    return taken[0]


def live(command):
    return watched(command, take_everything)


def page(command):
    return watched(command, take_the_page)


def figures(masseter, how, seconds):
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory() as folder:
            run = Path(folder) / "run"
            bytes_taken = how([masseter, "run", "--clock", "rt", "--duration", f"{seconds}s", "--out", str(run)])
            summary = json.loads((run / "summary.json").read_text())
        print(f"  {how.__name__:<9} {summary['verdict']['word']}", flush=True)
        if summary["figures"]["final_state"] == "finished":
            assert how not in (live, page) or bytes_taken > 500_000, bytes_taken
            return {interval["name"]: interval for interval in summary["figures"]["intervals"]}
    raise SystemExit(f"{TRIES} runs in a row did not come to their end: the machine is too disturbed")


def spread(values_ns):
    """Median, least and most, µs; a dash where a run was too short to tell."""
    if None in values_ns:
        return "–"
    middle, least, most = (of(values_ns) / 1e3 for of in (statistics.median, min, max))
    return f"{middle:.1f} ({least:.1f}–{most:.1f})"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masseter", type=Path)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=int, default=12)
    arguments = parser.parse_args()
    ways = [alone, terminal, live, page]
    chance = random.Random(1)
    runs = {way: [] for way in ways}
    for _ in range(arguments.rounds):
        for way in chance.sample(ways, len(ways)):
            runs[way].append(figures(str(arguments.masseter.resolve()), way, arguments.seconds))
    for name in INTERVALS:
        print(f"{name + ', µs':<24}" + "".join(f"{quantile.removesuffix('_ns'):>26}" for quantile in QUANTILES))
        for way in ways:
            cells = (spread([intervals[name][quantile] for intervals in runs[way]]) for quantile in QUANTILES)
            print(f"  {way.__name__:<22}" + "".join(f"{cell:>26}" for cell in cells))


if __name__ == "__main__":
    main()
