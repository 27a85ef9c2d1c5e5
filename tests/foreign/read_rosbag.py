"""Reads a recording with Python's `rosbags`, as a bag of ROS 2, and what is attached to it with `mcap`.

    tests/foreign/read_rosbag.py RUN_FOLDER

Compares decoded fields of every topic with each other and with `summary.json`. Fails when a topic or an attached file
is missing.
"""

import json
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

# A run in simulated time has no messages about the machine, and one without teeth and food none about contact.
TOPICS = {"command", "reading", "state", "truth", "frames", "event", "parameter", "/tf", "/scene"}

folder = Path(sys.argv[1])
summary = json.loads((folder / "summary.json").read_text())
topics = defaultdict(list)
with AnyReader([folder / "recording.mcap"]) as reader:
    assert {connection.topic for connection in reader.connections} == TOPICS | {"machine", "contact"}
    for connection, _, data in reader.messages():
        topics[connection.topic].append(reader.deserialize(data, connection.msgtype))

assert set(topics) == TOPICS, set(topics)
frames = [frame for message in topics["frames"] for frame in message.frames]
recorded = next(topic["messages"] for topic in summary["figures"]["topics"] if topic["topic"] == "frame")
assert len(frames) == recorded, (len(frames), recorded)
for name in TOPICS - {"/tf", "/scene", "frames"}:
    recorded = next(topic["messages"] for topic in summary["figures"]["topics"] if topic["topic"] == name)
    assert len(topics[name]) == recorded, (name, len(topics[name]), recorded)
commands = {command.cycle: command for command in topics["command"]}
truths = {truth.cycle: truth for truth in topics["truth"]}
assert all(reading.fresh_axes in range(64) for reading in topics["reading"])
assert all(commands[state.cycle].controller_state == state.controller_state for state in topics["state"])
assert {len(frame.data) for frame in frames} <= set(range(9))
sources = {event["source"] for event in summary["figures"]["events"]}
assert len({event.source for event in topics["event"]}) == len(sources), sources
by_time = {truth.sampled_ns: truth for truth in truths.values()}
shown = 0
for message in topics["/tf"]:
    for transform in message.transforms:
        stamp, place = transform.header.stamp, transform.transform.translation
        if transform.child_frame_id == "platform":
            truth = by_time[stamp.sec * 10**9 + stamp.nanosec]
            assert [place.x, place.y, place.z] == list(truth.position_m), truth.cycle
            shown += 1
assert shown > 100, shown
parts = {marker.ns for message in topics["/scene"] for marker in message.markers}
assert {"base", "legs", "jaw", "platform"} <= parts, parts

with open(folder / "recording.mcap", "rb") as file:
    attached = {attachment.name: attachment.data for attachment in make_reader(file).iter_attachments()}
assert set(attached) == {"scenario.toml", "circumstances.json"}, set(attached)
assert attached["scenario.toml"] == (folder / "scenario.toml").read_bytes()
tomllib.loads(attached["scenario.toml"].decode())
assert json.loads(attached["circumstances.json"])["motion_s"] > 0
print(f"{sum(map(len, topics.values()))} messages, attached: {', '.join(attached)}")
