"""Rerun reads a recording: by itself transforms and numbers, and by `examples/show_in_rerun.py` the mechanism too.

    tests/foreign/read_rerun.py RUN_FOLDER FOLDER
"""

import runpy
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from mcap_ros2.reader import read_ros2_messages
from rerun.chunk import McapReader, RrdReader

run, folder = Path(sys.argv[1]), Path(sys.argv[2])
script = Path(__file__).parents[2] / "examples" / "show_in_rerun.py"


def components(chunks):
    """The components of each entity."""
    found = defaultdict(set)
    for chunk in chunks:
        found[chunk.entity_path] |= set(chunk.to_record_batch().schema.names)
    return found


# The recording as it is.
chunks = McapReader(run / "recording.mcap").stream().to_chunks()
found = components(chunks)
assert {"Transform3D:translation", "Transform3D:quaternion", "Transform3D:parent_frame"} <= found["/tf"], found["/tf"]
for topic, name in (("command", "Command"), ("reading", "Reading"), ("state", "State"), ("truth", "Truth")):
    assert f"masseter.msg.{name}:message" in found[f"/{topic}"], found[f"/{topic}"]

# The file of the script: the shapes in their frames, and what it plots.
view = folder / "view.rrd"
subprocess.run([sys.executable, script, run, "--save", view], check=True)
shown = components(RrdReader(view).stream().to_chunks())
assert "Transform3D:translation" in shown["/tf"]
for part, shape in (
    ("legs/0", "LineStrips3D:strips"),
    ("legs/1", "Points3D:positions"),
    ("jaw/1", "LineStrips3D:strips"),
    ("platform/0", "Mesh3D:vertex_positions"),
):
    assert {shape, "CoordinateFrame:frame"} <= shown[f"/scene/{part}"], (part, shown[f"/scene/{part}"])

# Every curve's selector finds the numbers of the recording.
plots = runpy.run_path(script, run_name="plots")["PLOTS"]
assert len(plots) >= 4
curves = 0
for _, topic, message, fields in plots:
    recorded = [message.ros_msg for message in read_ros2_messages(str(run / "recording.mcap"), topics=[topic])]
    component = f"masseter.msg.{message}:message"
    of_topic = [chunk for chunk in chunks if component in chunk.to_record_batch().schema.names]
    for selector in fields.values():
        values = [
            value
            for chunk in of_topic
            for value in chunk.apply_selector(component, selector).to_record_batch().column(component).to_pylist()
        ]
        name, _, element = selector.strip(".]").partition("[")
        expected = [getattr(row, name)[int(element)] if element else getattr(row, name) for row in recorded]
        assert [value[0] for value in values] == expected, selector
        curves += 1
print(f"{len(found)} entities, {curves} curves")
