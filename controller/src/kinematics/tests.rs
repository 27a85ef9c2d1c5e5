//! Random mechanisms and poses for the tests of this module.

use masseter_model::geometry::{Actuators, Joints, Mechanism, MechanismConfig, Pose, SlideConfig, Vec3};
use nalgebra::{Translation3, UnitQuaternion};
use proptest::prelude::*;

use super::Equations;

pub(super) fn published_mechanism() -> Mechanism {
    Mechanism::new(&MechanismConfig::default()).expect("the default is a mechanism")
}

/// Mechanisms like the paper's with every dimension off: no equal sides, no even azimuths.
pub(super) fn mechanisms() -> impl Strategy<Value = Mechanism> {
    let slide = |azimuth: f64| {
        (0.05..0.065f64, -8.0..8.0f64, -6.0..6.0f64).prop_map(move |(radius, shift, skew)| {
            let (sin, cos) = (azimuth + shift).to_radians().sin_cos();
            SlideConfig { centre_m: [radius * cos, radius * sin], azimuth_deg: azimuth + shift + 90.0 + skew }
        })
    };
    let sides = [0.045..0.056f64, 0.045..0.056f64, 0.045..0.056f64];
    (slide(0.0), slide(120.0), slide(240.0), sides).prop_map(|(s1, s2, s3, platform_sides_m)| {
        let config = MechanismConfig { slides: [s1, s2, s3], platform_sides_m, ..Default::default() };
        Mechanism::new(&config).expect("the ranges hold mechanisms only")
    })
}

/// Poses in the middle of the workspace, turned by at most `turn_deg` about each axis.
pub(super) fn poses(turn_deg: f64) -> impl Strategy<Value = Pose> {
    let turn = turn_deg.to_radians();
    let angles = [-turn..turn, -turn..turn, -turn..turn];
    ([-0.015..0.015f64, -0.015..0.015f64, 0.245..0.29f64], angles).prop_map(
        |([x, y, z], [roll, pitch, yaw])| {
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            Pose::from_parts(Translation3::new(x, y, z), rotation)
        },
    )
}

/// Joint coordinates made by inverse kinematics, near a singularity.
#[derive(Debug)]
pub(super) struct NearlySingular {
    pub mechanism: Mechanism,
    pub joints: Joints,
    /// Of the Jacobian, with every leg's length taken as 1.
    pub determinant: f64,
}

/// A pose on a random path between two poses with determinants of opposite signs. A random determinant between 10⁻¹ and
/// 10⁻¹² gives the distance to the singularity.
pub(super) fn nearly_singular() -> impl Strategy<Value = NearlySingular> {
    let exponents = (-12.0..-1.0f64, prop::bool::ANY);
    let mechanisms = prop_oneof![Just(published_mechanism()), mechanisms()];
    let walks = (mechanisms, poses(80.0), poses(80.0), exponents);
    walks.prop_filter_map("the path crosses no singularity", |(mechanism, from, to, (exponent, positive))| {
        let target = 10f64.powf(exponent) * if positive { 1.0 } else { -1.0 };
        let at = |share: f64| {
            let position = from.translation.vector.lerp(&to.translation.vector, share);
            let pose = Pose::from_parts(position.into(), from.rotation.nlerp(&to.rotation, share));
            let joints = mechanism.inverse(&pose).ok()?;
            let equations = Equations::new(&mechanism, &joints.actuators);
            Some((joints, equations.determinant(&equations.evaluate(joints.theta_rad.into()))))
        };
        let (mut low, mut high) = (0.0, 1.0);
        let starts_above = at(low)?.1 > target;
        if (at(high)?.1 > target) == starts_above {
            return None;
        }
        let mut middle = 0.5;
        while low < middle && middle < high {
            *(if (at(middle)?.1 > target) == starts_above { &mut low } else { &mut high }) = middle;
            middle = f64::midpoint(low, high);
        }
        let (joints, determinant) = at(low)?;
        Some(NearlySingular { mechanism: mechanism.clone(), joints, determinant })
    })
}

/// Angle between two orientations, radians; unlike the arc cosine exact near zero.
pub(super) fn angle_between(a: &Pose, b: &Pose) -> f64 {
    let turn: Vec3 = (a.rotation.inverse() * b.rotation).scaled_axis();
    turn.norm()
}

/// An input with two solutions that meet every condition, the determinants being 0.045 and more.
pub(super) const AMBIGUOUS: Actuators = Actuators {
    slide_m: [0.010_137_353_810_067_46, 0.015_926_592_372_227_42, 0.020_840_656_757_742_57],
    leg_m: [0.246_449_456_124_783_5, 0.287_523_749_262_044_8, 0.270_252_791_539_176_8],
};
