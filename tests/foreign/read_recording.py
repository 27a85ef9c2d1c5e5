"""Reads a recording with Python's `mcap` packages, which know nothing of Masseter.

Prints the messages of each topic and fails when a topic is missing or a value makes no sense.
"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_ros2.reader import read_ros2_messages

LAYOUT_VERSION = 15
TOPICS = ("command", "reading", "state", "truth", "frames", "event", "parameter")

counts = Counter()
last_seq = {}
largest_angle_rad = 0.0
largest_data = 0
for message in read_ros2_messages(sys.argv[1], topics=TOPICS):
    topic, body = message.channel.topic, message.ros_msg
    counts[topic] += 1
    assert body.version == LAYOUT_VERSION, (topic, body.version)
    if topic not in ("event",):
        assert body.seq == last_seq.get(topic, 0) + 1, (topic, body.seq)
        last_seq[topic] = body.seq + (len(body.frames) - 1 if topic == "frames" else 0)
    if topic == "state":
        norm = sum(q * q for q in body.desired_quaternion_wxyz)
        assert abs(norm - 1.0) < 1e-9, norm
        largest_angle_rad = max(largest_angle_rad, *body.leg_angle_rad)
    if topic == "frames":
        assert body.frames[0].after_ns == 0 and len(body.frames) > 0, body
        waited_ns = body.time_ns - body.queued_ns
        for frame in body.frames:
            assert frame.bus in (0, 1) and len(frame.data) <= 8, (frame.bus, frame.data)
            waited_ns += frame.after_ns - frame.queued_after_ns
            assert 0 < waited_ns < 1_000_000_000, waited_ns
            largest_data = max(largest_data, len(frame.data))
    if topic == "parameter":
        assert (body.length, body.integral_gain_per_s, body.trim_limit_rad) == (5, 5.0, 0.02), body
    if topic == "reading" and body.fresh_axes == 63:
        assert all(0.24 <= length <= 0.30 for length in body.position_m[3:]), body.position_m

# Every field of the rig's messages says what it is, and its unit where it has one.
with open(sys.argv[1], "rb") as file:
    schemas = {schema.name: schema.data.decode() for schema in make_reader(file).get_summary().schemas.values()}
for name, definition in schemas.items():
    fields = [line for line in definition.splitlines() if line.startswith(("uint", "int", "float", "masseter/"))]
    if name.startswith("masseter/"):
        assert fields and all("  # " in field for field in fields), definition
assert "float64[6] position_m  # [m] Encoder positions" in schemas["masseter/msg/Reading"]
assert " 3 = running," in schemas["masseter/msg/State"]

for topic in TOPICS:
    print(f"{topic:8} {counts[topic]:8}")
    assert counts[topic] > 0, f"no message on {topic}"
assert largest_data == 8, largest_data
assert 1.0 < largest_angle_rad < 1.6, largest_angle_rad
