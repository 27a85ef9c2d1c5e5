"""Shows a recording in Rerun: the mechanism in 3-D, and plots.

    pip install rerun-sdk mcap-ros2-support
    python examples/show_in_rerun.py runs/latest              # opens the viewer
    python examples/show_in_rerun.py runs/latest --save run.rrd    # for `rerun run.rrd`, here or elsewhere

Rerun reads transforms and numbers of a recording by itself. It does not read the markers of ROS 2, which are the shapes of
the mechanism: this script draws them. It also says which numbers to plot.
"""

import argparse
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from mcap_ros2.reader import read_ros2_messages

LINE_STRIP, LINE_LIST, SPHERE_LIST, TRIANGLE_LIST = 4, 5, 7, 11
TIMELINE = "message_log_time"
# Title, topic, message, and its fields by their names in the legend.
PLOTS = (
    ("Platform, true position [m]", "truth", "Truth", {axis: f".position_m[{i}]" for i, axis in enumerate("xyz")}),
    ("Axes [m]", "reading", "Reading", {axis: f".position_m[{i}]" for i, axis in enumerate(("d1", "d2", "d3", "l1", "l2", "l3"))}),
    ("Forces of the actuators [N]", "reading", "Reading", {axis: f".force_n[{i}]" for i, axis in enumerate(("d1", "d2", "d3", "l1", "l2", "l3"))}),
    ("State of the controller", "state", "State", {"state": ".controller_state"}),
)


def plot(title, topic, message, fields):
    """A view with a curve for each field of a topic's messages."""
    curves = [
        rr.SeriesLines(names=name).visualizer(
            mappings=[
                rrb.encodings.VisualizerComponentMapping(
                    "Scalars:scalars",
                    rrb.encodings.ComponentSourceKind.SourceComponent,
                    source_component=f"masseter.msg.{message}:message",
                    selector=selector,
                )
            ]
        )
        for name, selector in fields.items()
    ]
    return rrb.TimeSeriesView(name=title, origin=f"/{topic}", overrides={f"/{topic}": curves})


def blueprint():
    """What the viewer shows."""
    scene = rrb.Spatial3DView(name="Mechanism", origin="/", contents=["/tf", "/scene/**"])
    return rrb.Blueprint(rrb.Horizontal(scene, rrb.Vertical(*(plot(*spec) for spec in PLOTS))))


def shape(marker):
    """A marker as Rerun's shape."""
    points = np.array([(point.x, point.y, point.z) for point in marker.points])
    color = [round(255 * part) for part in (marker.color.r, marker.color.g, marker.color.b, marker.color.a)]
    if marker.type == TRIANGLE_LIST:
        return rr.Mesh3D(vertex_positions=points, albedo_factor=color)
    if marker.type == SPHERE_LIST:
        return rr.Points3D(points, colors=color, radii=marker.scale.x / 2)
    lines = {LINE_STRIP: lambda: [points], LINE_LIST: lambda: points.reshape(-1, 2, 3)}[marker.type]()
    return rr.LineStrips3D(lines, colors=color, radii=marker.scale.x / 2)


def draw(recording):
    """Logs the shapes at their times in their frames."""
    for message in read_ros2_messages(recording, topics=["/scene"]):
        rr.set_time(TIMELINE, timestamp=np.datetime64(message.log_time_ns, "ns"))
        for marker in message.ros_msg.markers:
            part = f"/scene/{marker.ns}/{marker.id}"
            rr.log(part, rr.CoordinateFrame(marker.header.frame_id), shape(marker))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path, help="recording, or run folder")
    parser.add_argument("--save", type=Path, metavar="FILE.rrd", help="write a file for Rerun's viewer")
    arguments = parser.parse_args()
    recording = arguments.recording
    if recording.is_dir():
        recording = recording / "recording.mcap"
    rr.init("masseter", spawn=arguments.save is None, default_blueprint=blueprint())
    if arguments.save:
        rr.save(arguments.save, default_blueprint=blueprint())
    rr.log_file_from_path(recording)
    draw(recording)


if __name__ == "__main__":
    main()
