"""Reads what 3-D views are shown, with Python's `mcap` packages.

Fails when a frame of reference or a part of the mechanism is missing, or a leg does not end at the platform.
"""

import sys
from math import dist

from mcap_ros2.reader import read_ros2_messages

LINE_LIST = 5

frames, parts = {}, {}
messages = 0
for message in read_ros2_messages(sys.argv[1], topics=["/tf", "/scene"]):
    messages += 1
    if message.channel.topic == "/tf":
        frames |= {transform.child_frame_id: transform for transform in message.ros_msg.transforms}
    else:
        parts |= {(marker.ns, marker.id): marker for marker in message.ros_msg.markers}

assert set(frames) == {"platform", "platform_estimated", "platform_desired"}, set(frames)
assert {"base", "legs", "jaw", "platform"} <= {name for name, _ in parts}, set(parts)
assert all(abs(marker.pose.orientation.w - 1.0) < 1e-12 and marker.frame_locked for marker in parts.values())
legs = parts["legs", 0]
assert legs.type == LINE_LIST and 0.0 < legs.scale.x < 0.01 and legs.color.a == 1.0, legs
for hinge, corner in zip(legs.points[::2], legs.points[1::2]):
    length = dist((hinge.x, hinge.y, hinge.z), (corner.x, corner.y, corner.z))
    assert 0.24 <= length <= 0.30, length
print(f"{messages} messages, parts: {', '.join(sorted({name for name, _ in parts}))}")
