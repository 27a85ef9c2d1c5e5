"""Reads what 3-D views are shown, with Python's `mcap` packages and Foxglove's own schemas.

Fails when a frame of reference or a part of the mechanism is missing, or a leg does not end at the platform.
"""

import sys
from math import dist

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

frames, parts = {}, {}
messages = 0
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    for schema, channel, message, body in reader.iter_decoded_messages(topics=["/tf", "/scene"]):
        messages += 1
        if schema.name == "foxglove.FrameTransforms":
            frames |= {transform.child_frame_id: transform for transform in body.transforms}
        if schema.name == "foxglove.SceneUpdate":
            parts |= {entity.id: entity for entity in body.entities}

assert set(frames) == {"platform", "platform_estimated", "platform_desired"}, set(frames)
assert {"base", "legs", "jaw", "platform"} <= set(parts), set(parts)
ends = parts["legs"].lines[0].points
for hinge, corner in zip(ends[::2], ends[1::2]):
    length = dist((hinge.x, hinge.y, hinge.z), (corner.x, corner.y, corner.z))
    assert 0.24 <= length <= 0.30, length
print(f"{messages} messages, parts: {', '.join(sorted(parts))}")
