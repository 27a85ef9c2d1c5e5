//! The mechanism for 3-D views, made from `truth` and `state` at 60 Hz: `tf2_msgs/msg/TFMessage` and
//! `visualization_msgs/msg/MarkerArray` of ROS 2.
//!
//! Frames: `base`; in it `platform` (true), `platform_estimated` (by forward kinematics) and
//! `platform_desired`. Markers: base triangle with its slides, the three legs, the three platforms, and the
//! jaw's incisal point and condyles, which move with the true platform.

use masseter_model::geometry::{LEGS, Mechanism, Vec3};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::messages::{State, Truth};
use masseter_scenario::JawConfig;
use serde::Serialize;

/// Time between two updates, ns: the 60 Hz of a screen.
const EVERY_NS: u64 = SECOND_NS / 60;
/// Time between two updates of the parts at rest, for readers that begin in the middle, ns.
const STILL_EVERY_NS: u64 = SECOND_NS;
const BASE: &str = "base";
const TRUE: &str = "platform";
const ESTIMATED: &str = "platform_estimated";
const DESIRED: &str = "platform_desired";
const LINE_M: f64 = 0.003;
const POINT_M: f64 = 0.006;

const GREY: [f32; 4] = [0.45, 0.45, 0.5, 1.0];
const BLUE: [f32; 4] = [0.0, 0.45, 0.7, 1.0];
const ORANGE: [f32; 4] = [0.84, 0.37, 0.0, 0.5];
const GREEN: [f32; 4] = [0.0, 0.62, 0.45, 0.5];
const RED: [f32; 4] = [0.8, 0.2, 0.2, 1.0];

/// The scene at one instant.
pub(super) struct Shown {
    pub time_ns: u64,
    pub transforms: TfMessage,
    pub markers: Option<MarkerArray>,
}

/// The scene of a mechanism, updated by its messages.
#[derive(Debug, Clone)]
pub struct Scene {
    mechanism: Mechanism,
    jaw_points: [Vec3; 3],
    next_truth_ns: u64,
    next_state_ns: u64,
    next_still_ns: u64,
}

impl Scene {
    pub(super) const TRANSFORMS: &str = "/tf";
    pub(super) const MARKERS: &str = "/scene";

    /// The scene of a mechanism and the jaw on it.
    pub fn new(mechanism: &Mechanism, jaw: &JawConfig) -> Self {
        Self {
            mechanism: mechanism.clone(),
            jaw_points: jaw_points(jaw),
            next_truth_ns: 0,
            next_state_ns: 0,
            next_still_ns: 0,
        }
    }

    /// The true platform and the legs, if an update is due.
    pub(super) fn show_truth(&mut self, truth: &Truth) -> Option<Shown> {
        let time_ns = truth.sampled_ns;
        if !is_due(&mut self.next_truth_ns, time_ns, EVERY_NS) {
            return None;
        }
        let mut markers = self.legs(truth);
        if is_due(&mut self.next_still_ns, time_ns, STILL_EVERY_NS) {
            markers.extend(self.still(time_ns));
        }
        let platform = transform(time_ns, TRUE, truth.position_m, truth.quaternion_wxyz);
        Some(Shown {
            time_ns,
            transforms: TfMessage { transforms: vec![platform] },
            markers: Some(MarkerArray { markers }),
        })
    }

    /// The estimated and the desired platform, if an update is due.
    pub(super) fn show_state(&mut self, state: &State) -> Option<Shown> {
        let time_ns = state.sampled_ns;
        if state.reading_cycle == 0 || !is_due(&mut self.next_state_ns, time_ns, EVERY_NS) {
            return None;
        }
        let transforms = vec![
            transform(time_ns, ESTIMATED, state.estimated_position_m, state.estimated_quaternion_wxyz),
            transform(time_ns, DESIRED, state.desired_position_m, state.desired_quaternion_wxyz),
        ];
        Some(Shown { time_ns, transforms: TfMessage { transforms }, markers: None })
    }

    /// Legs from hinge to platform corner, with the hinges as points.
    fn legs(&self, truth: &Truth) -> Vec<Marker> {
        let pose = masseter_runtime::messages::pose_from_fields(truth.position_m, truth.quaternion_wxyz);
        let hinges: [Vec3; LEGS] = std::array::from_fn(|leg| self.mechanism.hinge(leg, truth.joint_m[leg]));
        let ends =
            hinges.iter().zip(self.mechanism.corners_at(&pose)).flat_map(|(hinge, corner)| [*hinge, corner]);
        let legs = marker(Shape::LineList, GREY, ends);
        let hinges = marker(Shape::SphereList, GREY, hinges);
        numbered_part("legs", BASE, truth.sampled_ns, vec![legs, hinges])
    }

    /// The parts that do not move in their frames.
    fn still(&self, time_ns: u64) -> Vec<Marker> {
        let [lowest, highest] = self.mechanism.strokes().slide_m;
        let slides = (0..LEGS).flat_map(|leg| [lowest, highest].map(|end| self.mechanism.hinge(leg, end)));
        let centres = std::array::from_fn(|leg| self.mechanism.hinge(leg, 0.0));
        let slides = marker(Shape::LineList, BLUE, slides);
        let base = numbered_part("base", BASE, time_ns, vec![closed_line(centres, GREY), slides]);
        let corners = *self.mechanism.platform_corners();
        let platform = |frame, colour| {
            let shapes = vec![marker(Shape::TriangleList, colour, corners), closed_line(corners, colour)];
            numbered_part(frame, frame, time_ns, shapes)
        };
        let jaw = vec![marker(Shape::SphereList, RED, self.jaw_points), closed_line(self.jaw_points, RED)];
        let jaw = numbered_part("jaw", TRUE, time_ns, jaw);
        [base, platform(TRUE, BLUE), platform(ESTIMATED, ORANGE), platform(DESIRED, GREEN), jaw].concat()
    }
}

/// Incisal point, left and right condyle in the platform frame: Bonwill's triangle, inclined by Balkwill's
/// angle, with the axes of the platform, which at the closed jaw are those of the jaw to within the
/// mechanism's own asymmetry.
pub fn jaw_points(jaw: &JawConfig) -> [Vec3; 3] {
    let incisal = Vec3::from(jaw.reference_point_m);
    let height = jaw.bonwill_side_m * 3f64.sqrt() / 2.0;
    let (sin, cos) = jaw.balkwill_angle_deg.to_radians().sin_cos();
    let condyle =
        |side: f64| incisal + Vec3::new(-height * cos, side * jaw.bonwill_side_m / 2.0, height * sin);
    [incisal, condyle(1.0), condyle(-1.0)]
}

/// Whether `next_ns` has come; then the one after it is set, without catching up.
fn is_due(next_ns: &mut u64, time_ns: u64, every_ns: u64) -> bool {
    let due = time_ns >= *next_ns;
    if due {
        *next_ns = (time_ns / every_ns + 1) * every_ns;
    }
    due
}

fn header(time_ns: u64, frame: &str) -> Header {
    Header { stamp: Time::from_ns(time_ns), frame_id: frame.to_owned() }
}

fn transform(time_ns: u64, child: &str, translation: [f64; 3], [w, x, y, z]: [f64; 4]) -> TransformStamped {
    TransformStamped {
        header: header(time_ns, BASE),
        child_frame_id: child.to_owned(),
        translation,
        rotation_xyzw: [x, y, z, w],
    }
}

/// The shapes of a part of the mechanism, numbered.
fn numbered_part(name: &str, frame: &str, time_ns: u64, mut shapes: Vec<Marker>) -> Vec<Marker> {
    for (id, shape) in (0..).zip(&mut shapes) {
        (shape.ns, shape.id, shape.header) = (name.to_owned(), id, header(time_ns, frame));
    }
    shapes
}

fn closed_line(corners: [Vec3; 3], colour: [f32; 4]) -> Marker {
    marker(Shape::LineStrip, colour, corners.into_iter().chain([corners[0]]))
}

fn marker(shape: Shape, color: [f32; 4], points: impl IntoIterator<Item = Vec3>) -> Marker {
    let scale = match shape {
        Shape::LineStrip | Shape::LineList => LINE_M,
        Shape::SphereList => POINT_M,
        Shape::TriangleList => 1.0,
    };
    Marker {
        shape: shape as i32,
        orientation_xyzw: [0.0, 0.0, 0.0, 1.0],
        scale: [scale; 3],
        color,
        frame_locked: true,
        points: points.into_iter().map(Into::into).collect(),
        ..Marker::default()
    }
}

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
    fn from_ns(time_ns: u64) -> Self {
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
#[derive(Debug, Clone, Default, Serialize)]
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

#[cfg(test)]
mod tests {
    use masseter_model::geometry::MechanismConfig;

    use super::*;

    fn scene() -> Scene {
        Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default())
    }

    #[test]
    fn a_thousand_cycles_a_second_are_shown_sixty_times() {
        let mut scene = scene();
        let shown = (0..1000).filter_map(|cycle| {
            scene.show_truth(&Truth {
                cycle,
                sampled_ns: SECOND_NS + cycle * 1_000_000,
                quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
                ..Default::default()
            })
        });
        let shown: Vec<_> = shown.collect();
        assert_eq!(shown.len(), 60);
        let markers = |shown: &Shown| shown.markers.as_ref().unwrap().markers.len();
        assert_eq!(markers(&shown[0]), 12, "what stands still comes once a second");
        assert!(shown[1..].iter().all(|shown| markers(shown) == 2));
    }

    #[test]
    fn legs_reach_from_their_hinges_to_the_platforms_corners() {
        let mut scene = scene();
        let truth = Truth {
            sampled_ns: 5,
            position_m: [0.0, 0.0, 0.268_452_355],
            quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
            ..Default::default()
        };
        let shown = scene.show_truth(&truth).unwrap();
        let points = &shown.markers.unwrap().markers[0].points;
        for ends in points.chunks(2) {
            let [from, to] = [ends[0], ends[1]].map(Vec3::from);
            assert!(((to - from).norm() - 0.27).abs() < 1e-6, "a leg of {} m", (to - from).norm());
        }
    }

    #[test]
    fn the_jaws_points_are_bonwills_triangle() {
        let jaw = JawConfig::default();
        let [incisal, left, right] = jaw_points(&jaw);
        for side in [left - incisal, right - incisal, left - right] {
            assert!((side.norm() - jaw.bonwill_side_m).abs() < 1e-12);
        }
    }
}
