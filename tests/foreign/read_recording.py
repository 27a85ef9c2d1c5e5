"""Reads a recording with Python's `mcap` packages, which know nothing of Masseter.

Prints the messages of each topic and fails when a topic is missing or a value makes no sense.
"""

import sys
from collections import Counter

from mcap_ros2.reader import read_ros2_messages

LAYOUT_VERSION = 13
TOPICS = ("command", "reading", "state", "truth", "frame", "event", "parameter")

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
        last_seq[topic] = body.seq
    if topic == "state":
        norm = sum(q * q for q in body.desired_quaternion_wxyz)
        assert abs(norm - 1.0) < 1e-9, norm
        largest_angle_rad = max(largest_angle_rad, *body.leg_angle_rad)
    if topic == "frame":
        assert body.bus in (0, 1) and len(body.data) <= 8, (body.bus, body.data)
        largest_data = max(largest_data, len(body.data))
    if topic == "parameter":
        assert (body.length, body.integral_gain_per_s, body.trim_limit_rad) == (5, 5.0, 0.02), body
    if topic == "reading" and body.fresh_axes == 63:
        assert all(0.24 <= length <= 0.30 for length in body.position_m[3:]), body.position_m

for topic in TOPICS:
    print(f"{topic:8} {counts[topic]:8}")
    assert counts[topic] > 0, f"no message on {topic}"
assert largest_data == 8, largest_data
assert 1.0 < largest_angle_rad < 1.6, largest_angle_rad
