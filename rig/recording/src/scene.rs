//! The mechanism for 3-D views: Foxglove's frame transforms and scene entities, made from `truth` and `state` at 60 Hz.
//!
//! Frames: `base`; in it `platform` (true), `platform_estimated` (by forward kinematics) and
//! `platform_desired`. Entities: base triangle with its slides, the three legs, the three platforms, and the
//! jaw's incisal point and condyles, which move with the true platform.

use foxglove::messages::line_primitive::Type as LineType;
use foxglove::messages::{
    Color, FrameTransform, FrameTransforms, LinePrimitive, Point3, Pose as FoxglovePose, Quaternion,
    SceneEntity, SceneUpdate, SpherePrimitive, Timestamp, TriangleListPrimitive, Vector3,
};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::config::JawConfig;
use masseter_shared::geometry::{LEGS, Mechanism, Vec3};
use masseter_shared::messages::{State, Truth};

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

const GREY: [f64; 4] = [0.45, 0.45, 0.5, 1.0];
const BLUE: [f64; 4] = [0.0, 0.45, 0.7, 1.0];
const ORANGE: [f64; 4] = [0.84, 0.37, 0.0, 0.5];
const GREEN: [f64; 4] = [0.0, 0.62, 0.45, 0.5];
const RED: [f64; 4] = [0.8, 0.2, 0.2, 1.0];

/// The scene at one instant.
pub(super) struct Shown {
    pub time_ns: u64,
    pub transforms: FrameTransforms,
    pub entities: Option<SceneUpdate>,
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
    pub(super) const ENTITIES: &str = "/scene";

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
    pub(super) fn truth(&mut self, truth: &Truth) -> Option<Shown> {
        let time_ns = truth.sampled_ns;
        if !is_due(&mut self.next_truth_ns, time_ns, EVERY_NS) {
            return None;
        }
        let mut entities = vec![self.legs(truth)];
        if is_due(&mut self.next_still_ns, time_ns, STILL_EVERY_NS) {
            entities.extend(self.still(time_ns));
        }
        let platform = transform(time_ns, TRUE, truth.position_m, truth.quaternion_wxyz);
        Some(Shown {
            time_ns,
            transforms: FrameTransforms { transforms: vec![platform] },
            entities: Some(SceneUpdate { deletions: Vec::new(), entities }),
        })
    }

    /// The estimated and the desired platform, if an update is due.
    pub(super) fn state(&mut self, state: &State) -> Option<Shown> {
        let time_ns = state.sampled_ns;
        if state.reading_cycle == 0 || !is_due(&mut self.next_state_ns, time_ns, EVERY_NS) {
            return None;
        }
        let transforms = vec![
            transform(time_ns, ESTIMATED, state.estimated_position_m, state.estimated_quaternion_wxyz),
            transform(time_ns, DESIRED, state.desired_position_m, state.desired_quaternion_wxyz),
        ];
        Some(Shown { time_ns, transforms: FrameTransforms { transforms }, entities: None })
    }

    /// Legs from hinge to platform corner, with the hinges as points.
    fn legs(&self, truth: &Truth) -> SceneEntity {
        let pose = masseter_shared::messages::pose_from_fields(truth.position_m, truth.quaternion_wxyz);
        let hinges: [Vec3; LEGS] = std::array::from_fn(|leg| self.mechanism.hinge(leg, truth.joint_m[leg]));
        let ends =
            hinges.iter().zip(self.mechanism.corners_at(&pose)).flat_map(|(hinge, corner)| [*hinge, corner]);
        SceneEntity {
            lines: vec![lines(LineType::LineList, ends, GREY)],
            spheres: hinges.iter().map(|hinge| sphere(*hinge, GREY)).collect(),
            ..entity("legs", BASE, truth.sampled_ns)
        }
    }

    /// The parts that do not move in their frames.
    fn still(&self, time_ns: u64) -> Vec<SceneEntity> {
        let [lowest, highest] = self.mechanism.strokes().slide_m;
        let slides = (0..LEGS).flat_map(|leg| [lowest, highest].map(|end| self.mechanism.hinge(leg, end)));
        let centres = (0..LEGS).map(|leg| self.mechanism.hinge(leg, 0.0));
        let base = SceneEntity {
            lines: vec![lines(LineType::LineLoop, centres, GREY), lines(LineType::LineList, slides, BLUE)],
            ..entity("base", BASE, time_ns)
        };
        let platform = |frame, colour| SceneEntity {
            triangles: vec![TriangleListPrimitive {
                points: self.mechanism.platform_corners().iter().map(|corner| point(*corner)).collect(),
                color: Some(colour_of(colour)),
                pose: Some(at(Vec3::zeros())),
                ..Default::default()
            }],
            lines: vec![lines(LineType::LineLoop, self.mechanism.platform_corners().iter().copied(), colour)],
            ..entity(frame, frame, time_ns)
        };
        let jaw = SceneEntity {
            spheres: self.jaw_points.iter().map(|point| sphere(*point, RED)).collect(),
            lines: vec![lines(LineType::LineLoop, self.jaw_points.iter().copied(), RED)],
            ..entity("jaw", TRUE, time_ns)
        };
        vec![base, platform(TRUE, BLUE), platform(ESTIMATED, ORANGE), platform(DESIRED, GREEN), jaw]
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

fn timestamp(time_ns: u64) -> Timestamp {
    Timestamp::new((time_ns / SECOND_NS) as u32, (time_ns % SECOND_NS) as u32)
}

fn transform(time_ns: u64, child: &str, [x, y, z]: [f64; 3], quaternion: [f64; 4]) -> FrameTransform {
    let [qw, qx, qy, qz] = quaternion;
    FrameTransform {
        timestamp: Some(timestamp(time_ns)),
        parent_frame_id: BASE.to_owned(),
        child_frame_id: child.to_owned(),
        translation: Some(Vector3 { x, y, z }),
        rotation: Some(Quaternion { x: qx, y: qy, z: qz, w: qw }),
    }
}

fn entity(id: &str, frame: &str, time_ns: u64) -> SceneEntity {
    SceneEntity {
        timestamp: Some(timestamp(time_ns)),
        frame_id: frame.to_owned(),
        id: id.to_owned(),
        frame_locked: true,
        ..Default::default()
    }
}

fn lines(kind: LineType, points: impl Iterator<Item = Vec3>, colour: [f64; 4]) -> LinePrimitive {
    LinePrimitive {
        r#type: kind.into(),
        pose: Some(at(Vec3::zeros())),
        thickness: LINE_M,
        points: points.map(point).collect(),
        color: Some(colour_of(colour)),
        ..Default::default()
    }
}

fn sphere(centre: Vec3, colour: [f64; 4]) -> SpherePrimitive {
    let size = Some(Vector3 { x: POINT_M, y: POINT_M, z: POINT_M });
    SpherePrimitive { pose: Some(at(centre)), size, color: Some(colour_of(colour)) }
}

fn at(place: Vec3) -> FoxglovePose {
    FoxglovePose {
        position: Some(Vector3 { x: place.x, y: place.y, z: place.z }),
        orientation: Some(Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 }),
    }
}

fn point(place: Vec3) -> Point3 {
    Point3 { x: place.x, y: place.y, z: place.z }
}

fn colour_of([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}

#[cfg(test)]
mod tests {
    use masseter_shared::geometry::MechanismConfig;

    use super::*;

    fn scene() -> Scene {
        Scene::new(&Mechanism::new(&MechanismConfig::default()).unwrap(), &JawConfig::default())
    }

    #[test]
    fn a_thousand_cycles_a_second_are_shown_sixty_times() {
        let mut scene = scene();
        let shown = (0..1000).filter_map(|cycle| {
            scene.truth(&Truth {
                cycle,
                sampled_ns: SECOND_NS + cycle * 1_000_000,
                quaternion_wxyz: [1.0, 0.0, 0.0, 0.0],
                ..Default::default()
            })
        });
        let shown: Vec<_> = shown.collect();
        assert_eq!(shown.len(), 60);
        let entities = |shown: &Shown| shown.entities.as_ref().unwrap().entities.len();
        assert_eq!(entities(&shown[0]), 6, "what stands still comes once a second");
        assert!(shown[1..].iter().all(|shown| entities(shown) == 1));
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
        let shown = scene.truth(&truth).unwrap();
        let points = &shown.entities.unwrap().entities[0].lines[0].points;
        for ends in points.chunks(2) {
            let [from, to] = [&ends[0], &ends[1]].map(|p| Vec3::new(p.x, p.y, p.z));
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
