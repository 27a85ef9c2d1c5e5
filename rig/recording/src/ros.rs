//! The messages of ROS 2 that 3-D views show: `tf2_msgs/msg/TFMessage` and `visualization_msgs/msg/MarkerArray`.

use masseter_runtime::clock::SECOND_NS;
use serde::Serialize;

/// A message with its type.
pub(super) trait RosMessage: Serialize {
    const TYPE_NAME: &str;
    const DEFINITION: &str;
}

impl RosMessage for TfMessage {
    const TYPE_NAME: &str = "tf2_msgs/msg/TFMessage";
    const DEFINITION: &str = include_str!("../schemas/TFMessage.msg");
}

impl RosMessage for MarkerArray {
    const TYPE_NAME: &str = "visualization_msgs/msg/MarkerArray";
    const DEFINITION: &str = include_str!("../schemas/MarkerArray.msg");
}

/// A time, or a duration.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub(super) struct Time {
    sec: i32,
    nanosec: u32,
}

impl Time {
    /// The time wraps after 68 years.
    pub(super) fn from_ns(time_ns: u64) -> Self {
        Self { sec: (time_ns / SECOND_NS) as i32, nanosec: (time_ns % SECOND_NS) as u32 }
    }
}

#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

/// Poses of frames.
#[derive(Debug, Clone, Serialize)]
pub(super) struct TfMessage {
    pub transforms: Vec<TransformStamped>,
}

/// The pose of a frame in its parent, which the header names.
#[derive(Debug, Clone, Serialize)]
pub(super) struct TransformStamped {
    pub header: Header,
    pub child_frame_id: String,
    pub translation: [f64; 3],
    pub rotation_xyzw: [f64; 4],
}

/// Shapes in frames. A shape replaces the earlier one with its name and number.
#[derive(Debug, Clone, Serialize)]
pub(super) struct MarkerArray {
    pub markers: Vec<Marker>,
}

/// The shape of a marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    LineStrip = 4,
    LineList = 5,
    SphereList = 7,
    TriangleList = 11,
}

/// A shape in the frame of its header, for ever.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Marker {
    pub header: Header,
    pub ns: String,
    pub id: i32,
    pub shape: i32,
    pub action: i32,
    pub position: [f64; 3],
    pub orientation_xyzw: [f64; 4],
    /// Width of lines, or diameters.
    pub scale: [f64; 3],
    pub color: [f32; 4],
    pub lifetime: Time,
    pub frame_locked: bool,
    pub points: Vec<[f64; 3]>,
    pub unused: Unused,
}

/// What only textures, texts and meshes need.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Unused {
    colors: Vec<[f32; 4]>,
    texture_resource: String,
    texture: (Header, String, Vec<u8>),
    uv_coordinates: Vec<[f32; 2]>,
    text: String,
    mesh_resource: String,
    mesh_file: (String, Vec<u8>),
    mesh_use_embedded_materials: bool,
}
