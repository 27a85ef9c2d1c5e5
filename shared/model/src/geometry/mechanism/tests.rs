use nalgebra::{Translation3, UnitQuaternion};
use proptest::prelude::*;

use super::*;

/// Any mechanism that a builder can declare, not only the paper's.
fn mechanisms() -> impl Strategy<Value = Mechanism> {
    let slide = |azimuth: f64| {
        (0.04..0.09f64, -15.0..15.0f64, -10.0..10.0f64).prop_map(move |(radius, shift, skew)| {
            let (sin, cos) = (azimuth + shift).to_radians().sin_cos();
            SlideConfig { centre_m: [radius * cos, radius * sin], azimuth_deg: azimuth + shift + 90.0 + skew }
        })
    };
    let sides = [0.045..0.06f64, 0.045..0.06f64, 0.045..0.06f64];
    (slide(0.0), slide(120.0), slide(240.0), sides).prop_map(|(s1, s2, s3, platform_sides_m)| {
        let config = MechanismConfig { slides: [s1, s2, s3], platform_sides_m, ..Default::default() };
        Mechanism::new(&config).unwrap()
    })
}

fn poses() -> impl Strategy<Value = Pose> {
    let position = [-0.05..0.05f64, -0.05..0.05f64, 0.15..0.35f64];
    let rotation = [-0.7..0.7f64, -0.7..0.7f64, -0.7..0.7f64];
    (position, rotation).prop_map(|([x, y, z], rotation)| {
        let rotation = UnitQuaternion::from_scaled_axis(Vec3::from(rotation));
        Pose::from_parts(Translation3::new(x, y, z), rotation)
    })
}

proptest! {
    /// Each loop closes: hinge plus leg ends at the platform's corner.
    #[test]
    fn joint_coordinates_close_the_loops(mechanism in mechanisms(), pose in poses()) {
        let joints = mechanism.inverse(&pose).unwrap();
        let rebuilt = mechanism.corners_from_angles(&joints.actuators, &joints.theta_rad);
        for (rebuilt, corner) in rebuilt.iter().zip(mechanism.corners_at(&pose)) {
            prop_assert!((rebuilt - corner).norm() < 1e-12);
        }
    }

    /// The corners of the joint coordinates give back the original pose.
    #[test]
    fn pose_survives_the_way_through_the_corners(mechanism in mechanisms(), pose in poses()) {
        let again = frame_of_corners(&mechanism.corners_at(&pose));
        prop_assert!((again.translation.vector - pose.translation.vector).norm() < 1e-12);
        prop_assert!(again.rotation.angle_to(&pose.rotation) < 1e-7);
    }
}

#[test]
fn neutral_pose_of_the_paper() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let pose = Pose::translation(0.0, 0.0, 0.268_452_355_053_9);
    let joints = mechanism.inverse(&pose).unwrap();
    for leg in 0..LEGS {
        assert!(joints.actuators.slide_m[leg].abs() < 1e-12);
        assert!((joints.actuators.leg_m[leg] - 0.27).abs() < 1e-9);
        assert!((joints.theta_rad[leg].to_degrees() - 83.862_391_93).abs() < 1e-7);
    }
}

#[test]
fn a_pose_that_is_not_finite_is_refused() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    for x_m in [f64::NAN, f64::INFINITY, 1e160] {
        let pose = Pose::translation(x_m, 0.0, 0.27);
        assert_eq!(mechanism.inverse(&pose), Err(InverseError::NotFinite), "{x_m}");
        assert_eq!(mechanism.legs(&pose), Err(InverseError::NotFinite), "{x_m}");
    }
}

#[test]
fn the_default_is_the_papers_mechanism() {
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let [b1, b2, b3] = [0, 1, 2].map(|leg| mechanism.hinge(leg, 0.0));
    for side in [b2 - b1, b3 - b2, b1 - b3] {
        assert!((side.norm() - 0.10).abs() < 1e-12);
    }
    // Condition 2 of the paper fixes the reading: slide 1 is parallel to A₂A₃, A₂ beyond A₃.
    let [_, a2, a3] = mechanism.platform_corners();
    assert!(((a2 - a3).normalize() - mechanism.slide_direction(0)).norm() < 1e-12);
}

#[test]
fn corners_keep_the_declared_sides_and_the_frame() {
    let config = MechanismConfig { platform_sides_m: [0.05, 0.06, 0.045], ..Default::default() };
    let mechanism = Mechanism::new(&config).unwrap();
    let [a1, a2, a3] = *mechanism.platform_corners();
    assert!(((a1 - a2).norm() - 0.05).abs() < 1e-12);
    assert!(((a2 - a3).norm() - 0.06).abs() < 1e-12);
    assert!(((a3 - a1).norm() - 0.045).abs() < 1e-12);
    assert!((a1 + a2 + a3).norm() < 1e-12);
    assert!(a1.x > 0.0 && a1.y.abs() < 1e-12);
    assert!((a2 - a1).cross(&(a3 - a1)).z > 0.0);
}

#[test]
fn impossible_dimensions_are_refused_with_their_reason() {
    let good = MechanismConfig::default();
    let mut outward = good.clone();
    outward.slides[1].azimuth_deg += 180.0;
    let mut flat = good.clone();
    flat.slides = [0.0, 0.05, 0.1].map(|x| SlideConfig { centre_m: [x, 0.0], azimuth_deg: 90.0 });
    let mut clockwise = good.clone();
    clockwise.slides.swap(1, 2);
    let mut boundless = good.clone();
    boundless.slides[0].centre_m = [1e200, 1e200];
    let mut adrift = good.clone();
    adrift.slides[2].azimuth_deg = f64::NAN;
    let mut vanishing = good.clone();
    vanishing.strokes.leg_m = [0.0, 0.3];
    let with_sides = |platform_sides_m| MechanismConfig { platform_sides_m, ..good.clone() };
    let cases = [
        (with_sides([0.05, 0.05, 0.1]), "close to no triangle"),
        (with_sides([f64::NAN, 0.05, 0.1]), "platform_sides_m: NaN m; use 0.001 to 100 m"),
        (with_sides([1e200; LEGS]), "platform_sides_m: 1e200 m; use 0.001 to 100 m"),
        (with_sides([1e-100; LEGS]), "use 0.001 to 100 m"),
        (with_sides([0.05, -0.05, 0.05]), "use 0.001 to 100 m"),
        (outward, "add 180"),
        (flat, "one line"),
        (clockwise, "counter-clockwise seen from above"),
        (boundless, "slides.centre_m: 1e200 m; use -100 to 100 m"),
        (adrift, "slides[2]: the azimuth is NaN; give a finite number"),
        (vanishing, "above 0"),
    ];
    for (config, reason) in cases {
        let error = Mechanism::new(&config).unwrap_err().to_string();
        assert!(error.contains(reason), "{error}");
    }
}
