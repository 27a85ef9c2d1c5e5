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
# Where the eye is and looks, m: the whole mechanism with the jaw above it.
EYE_M, TARGET_M = (0.34, -0.38, 0.3), (0.0, 0.0, 0.17)
# Of the curves of a plot, in turn; also colour-blind people tell them apart.
COLORS = ((0, 114, 178), (213, 94, 0), (0, 158, 115))
SLIDES, LEGS = {"d1": 0, "d2": 1, "d3": 2}, {"l1": 3, "l2": 4, "l3": 5}


def fields(name, elements):
    """The elements of a field by their names in the legend."""
    return {title: f".{name}[{element}]" for title, element in elements.items()}


# Title, topic, message, and its fields by their names in the legend.
PLOTS = (
    ("Height of the platform [m]", "truth", "Truth", fields("position_m", {"z": 2})),
    ("Lengths of the legs [m]", "truth", "Truth", fields("joint_m", LEGS)),
    ("Positions of the slides [m]", "truth", "Truth", fields("joint_m", SLIDES)),
    ("Forces in the legs [N]", "reading", "Reading", fields("force_n", LEGS)),
    ("Forces of the slides [N]", "reading", "Reading", fields("force_n", SLIDES)),
    ("State of the controller, code", "state", "State", {"state": ".controller_state"}),
)


def plot(title, topic, message, fields):
    """A view with a curve for each field of a topic's messages."""
    curves = [
        rr.SeriesLines(names=name, colors=color).visualizer(
            mappings=[
                rrb.encodings.VisualizerComponentMapping(
                    "Scalars:scalars",
                    rrb.encodings.ComponentSourceKind.SourceComponent,
                    source_component=f"masseter.msg.{message}:message",
                    selector=selector,
                )
            ]
        )
        for (name, selector), color in zip(fields.items(), COLORS)
    ]
    legend = rrb.Corner2D.LeftTop
    return rrb.TimeSeriesView(name=title, origin=f"/{topic}", overrides={f"/{topic}": curves}, plot_legend=legend)


def blueprint():
    """What the viewer shows."""
    eye = rrb.EyeControls3D(position=EYE_M, look_target=TARGET_M, eye_up=(0.0, 0.0, 1.0))
    scene = rrb.Spatial3DView(name="Mechanism", origin="/", contents=["/tf", "/scene/**"], eye_controls=eye)
    plots = rrb.Vertical(*(plot(*spec) for spec in PLOTS))
    panels = (
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
    )
    return rrb.Blueprint(rrb.Horizontal(scene, plots, column_shares=[2, 3]), *panels)


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
