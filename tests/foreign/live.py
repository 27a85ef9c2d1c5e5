"""Watches a run with Python's `websockets`, and decodes what it sees by the schemas it is told.

    tests/foreign/live.py target/release/masseter RUN_FOLDER

A second watcher is killed during the run. Fails when a channel or a message is missing or makes no sense, or when
the recording of the watched run is not complete.
"""

import json
import multiprocessing
import struct
import subprocess
import sys
from collections import Counter
from contextlib import contextmanager
from pathlib import Path

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

TOPICS = ("command", "reading", "state", "truth", "frame", "event", "machine", "parameter", "/tf", "/scene")
RARE = ("event", "machine", "parameter", "/tf", "/scene")
DECODED_ONE_IN = 20
# Set by the watcher.
GAIN_PER_S = 6.5
PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
# Opcode, subscription and time, before the message itself.
MESSAGE_HEAD = struct.Struct("<BIQ")
LENIENT = Path(__file__).parents[1] / "lenient.toml"
# Passed, or the verdict names the machine as the cause of missed cycles.
PASSED_OR_INVALID = (0, 3)


@contextmanager
def open_and_subscribe(url):
    """A connection that will get every topic, and the channel of each subscription."""
    with connect(url, subprotocols=PROTOCOLS, max_size=None) as link:
        yield link, subscribe_to_all(link)


def subscribe_to_all(link):
    """Asks for every topic; returns the channel of each subscription."""
    info, advertised = json.loads(link.recv()), json.loads(link.recv())
    assert info["op"] == "serverInfo" and advertised["op"] == "advertise", (info, advertised)
    channels = {channel["id"] + 1: channel for channel in advertised["channels"]}
    assert {channel["topic"] for channel in channels.values()} == {*TOPICS, "contact"}, channels
    wanted = [{"id": number, "channelId": channel["id"]} for number, channel in channels.items()]
    link.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
    return channels


def decoder_of(channel):
    """How the channel's messages are decoded by its schema."""
    data = channel["schema"].encode()
    schema = Schema(id=channel["id"] + 1, data=data, encoding=channel["schemaEncoding"], name=channel["schemaName"])
    return DecoderFactory().decoder_for(channel["encoding"], schema)


def desert(url, is_watching):
    """Watches a little, then stops reading and waits to be killed."""
    with open_and_subscribe(url) as (link, _):
        link.recv()
        is_watching.set()
        multiprocessing.Event().wait()


def watch(link, channels, on_thousandth):
    """Takes every message until the rig says goodbye; returns how many came of each topic, and the parts of the scene."""
    decoders = {number: decoder_of(channel) for number, channel in channels.items()}
    counts, parts, last_cycle = Counter(), set(), 0
    try:
        while True:
            data = link.recv()
            opcode, number, log_time_ns = MESSAGE_HEAD.unpack_from(data)
            assert opcode == 1, opcode
            topic = channels[number]["topic"]
            counts[topic] += 1
            if counts.total() == 1000:
                on_thousandth()
            # Python decodes slower than the rig speaks.
            if topic not in RARE and counts[topic] % DECODED_ONE_IN > 0:
                continue
            message = decoders[number](data[MESSAGE_HEAD.size :])
            if topic == "state" and message.reading_cycle:
                assert message.cycle > last_cycle, (message.cycle, last_cycle)
                last_cycle = message.cycle
                assert abs(sum(q * q for q in message.estimated_quaternion_wxyz) - 1) < 1e-9
                assert abs(log_time_ns - message.published_ns) < 1_000_000_000, log_time_ns
            if topic == "parameter":
                assert message.integral_gain_per_s == GAIN_PER_S, message
            if topic == "/scene":
                parts |= {marker.ns for marker in message.markers}
    except ConnectionClosed as end:
        assert end.rcvd and end.rcvd.code == 1001, end
    return counts, parts


def watch_a_run(masseter, out):
    """Starts a run, and a second watcher that is killed on the way; returns what the first one saw."""
    arguments = [masseter, "run", LENIENT, "--clock", "rt", "--live=127.0.0.1:0", "--duration", "5s", "--out", out]
    rig = subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True)
    url = next(line.split()[2] for line in rig.stderr if line.startswith("live on "))

    is_watching = multiprocessing.Event()
    deserter = multiprocessing.Process(target=desert, args=(url, is_watching), daemon=True)
    deserter.start()
    assert is_watching.wait(10)

    with open_and_subscribe(url) as (link, channels):
        gain = {"name": "integral_gain_per_s", "value": GAIN_PER_S}
        link.send(json.dumps({"op": "setParameters", "parameters": [gain]}))
        seen = watch(link, channels, on_thousandth=deserter.kill)
    said = rig.stderr.read()
    assert rig.wait() in PASSED_OR_INVALID, (rig.returncode, said)
    deserter.join()
    assert deserter.exitcode == -9, deserter.exitcode
    return seen


def main():
    masseter, out = sys.argv[1:]
    counts, parts = watch_a_run(masseter, out)
    subprocess.run([masseter, "recording", "verify", out], check=True, stdout=subprocess.DEVNULL)
    for topic in TOPICS:
        print(f"{topic:8} {counts[topic]:8}")
        assert counts[topic] > 0, f"no message on {topic}"
    assert {"base", "legs", "jaw", "platform"} <= parts, parts


# Processes that are spawned import this file.
if __name__ == "__main__":
    main()
