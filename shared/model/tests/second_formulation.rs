//! Inverse kinematics and Jacobian against a second formulation. Plant and controller share both, so an error in them
//! cancels out of every tracking figure.
//!
//! The second formulation is the loop closure of each leg, from the dimensions alone: Cᵢ + dᵢûᵢ + lᵢ(cos θᵢ v̂ᵢ + sin
//! θᵢ ẑ) − (p + R Pᵢ) = 0. Its derivatives are central differences. The second formulation calls nothing of `geometry`.

use masseter_model::geometry::{Jacobian, LEGS, Mechanism, MechanismConfig, Pose, SlideConfig};
use nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

type Vec3 = Vector3<f64>;

/// Step of the central differences, m or rad.
const STEP: f64 = 1e-6;

/// Corner Pᵢ in the platform frame: origin at the centroid, x towards P₁, counter-clockwise.
fn platform_corner(sides_m: [f64; LEGS], leg: usize) -> Vec3 {
    let [a, b, c] = sides_m;
    let x = (a * a + c * c - b * b) / (2.0 * a);
    let flat = [[0.0, 0.0], [a, 0.0], [x, (c * c - x * x).sqrt()]];
    let centroid = [0, 1].map(|axis| (flat[0][axis] + flat[1][axis] + flat[2][axis]) / 3.0);
    let from_centroid = |corner: [f64; 2]| [corner[0] - centroid[0], corner[1] - centroid[1]];
    let [x1, y1] = from_centroid(flat[0]);
    let [x, y] = from_centroid(flat[leg]);
    let turn = -y1.atan2(x1);
    Vec3::new(x * turn.cos() - y * turn.sin(), x * turn.sin() + y * turn.cos(), 0.0)
}

/// R Pᵢ by Hamilton's product q P q*.
fn rotated([w, x, y, z]: [f64; 4], point: &Vec3) -> Vec3 {
    let axis = Vec3::new(x, y, z);
    let moved = point * w + axis.cross(point);
    axis * axis.dot(point) + moved * w - moved.cross(&axis)
}

/// One leg's loop closure, metres, at joints (d, l, θ) and a pose.
fn loop_closure(
    config: &MechanismConfig,
    leg: usize,
    [slide_m, leg_m, theta_rad]: [f64; 3],
    position_m: Vec3,
    rotation: [f64; 4],
) -> Vec3 {
    let SlideConfig { centre_m: [x, y], azimuth_deg } = config.slides[leg];
    let azimuth = azimuth_deg / 180.0 * std::f64::consts::PI;
    let along = Vec3::new(azimuth.cos(), azimuth.sin(), 0.0);
    let leg_direction =
        Vec3::new(-azimuth.sin() * theta_rad.cos(), azimuth.cos() * theta_rad.cos(), theta_rad.sin());
    let on_leg = Vec3::new(x, y, 0.0) + along * slide_m + leg_direction * leg_m;
    on_leg - position_m - rotated(rotation, &platform_corner(config.platform_sides_m, leg))
}

/// A quaternion turned by a small rotation vector in the base frame.
fn turned([w, x, y, z]: [f64; 4], by: Vec3) -> [f64; 4] {
    let half = by.norm() / 2.0;
    let axis = if half > 0.0 { by * (half.sin() / (2.0 * half)) } else { by / 2.0 };
    let (c, v) = (half.cos(), Vec3::new(x, y, z));
    let vector = v * c + axis * w + axis.cross(&v);
    [c * w - axis.dot(&v), vector.x, vector.y, vector.z]
}

fn mechanism_configs() -> impl Strategy<Value = MechanismConfig> {
    let slide = |azimuth_deg: f64| {
        (0.04..0.08f64, -15.0..15.0f64, -15.0..15.0f64).prop_map(move |(radius_m, shift_deg, skew_deg)| {
            let (sin, cos) = (azimuth_deg + shift_deg).to_radians().sin_cos();
            SlideConfig {
                centre_m: [radius_m * cos, radius_m * sin],
                azimuth_deg: azimuth_deg + 90.0 + skew_deg,
            }
        })
    };
    let sides = prop::array::uniform3(0.04..0.06f64);
    (slide(0.0), slide(120.0), slide(240.0), sides).prop_map(|(one, two, three, platform_sides_m)| {
        MechanismConfig { slides: [one, two, three], platform_sides_m, ..Default::default() }
    })
}

fn poses() -> impl Strategy<Value = (Vec3, [f64; 4])> {
    let position = [-0.03..0.03f64, -0.03..0.03f64, 0.2..0.32f64];
    (position, prop::array::uniform3(-1.0..1.0f64))
        .prop_map(|(position, turn)| (Vec3::from(position), turned([1.0, 0.0, 0.0, 0.0], Vec3::from(turn))))
}

fn pose(position_m: Vec3, [w, x, y, z]: [f64; 4]) -> Pose {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Pose::from_parts(Translation3::from(position_m), rotation)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn the_inverse_closes_every_loop(config in mechanism_configs(), (position_m, rotation) in poses()) {
        let mechanism = Mechanism::new(&config).unwrap();
        let joints = mechanism.inverse(&pose(position_m, rotation)).unwrap();
        for leg in 0..LEGS {
            let (slide_m, leg_m) = (joints.actuators.slide_m[leg], joints.actuators.leg_m[leg]);
            prop_assert!(leg_m > 0.0);
            let open_m =
                loop_closure(&config, leg, [slide_m, leg_m, joints.theta_rad[leg]], position_m, rotation);
            prop_assert!(open_m.norm() < 1e-14, "leg {leg} is open by {open_m:?} m");
        }
    }

    /// The closure stays 0 along a motion: ∂Φ/∂(d, l, θ) · q̇ = −∂Φ/∂pose · twist, for each of the six unit twists.
    #[test]
    fn the_jacobian_keeps_every_loop_closed(config in mechanism_configs(), (position_m, rotation) in poses()) {
        let mechanism = Mechanism::new(&config).unwrap();
        let at = pose(position_m, rotation);
        let joints = mechanism.inverse(&at).unwrap();
        let jacobian = Jacobian::new(&mechanism, &at, &joints);
        for leg in 0..LEGS {
            let q = [joints.actuators.slide_m[leg], joints.actuators.leg_m[leg], joints.theta_rad[leg]];
            let per_joint = Matrix3::from_columns(&[0, 1, 2].map(|joint| {
                let shifted = |by: f64| {
                    let mut q = q;
                    q[joint] += by;
                    loop_closure(&config, leg, q, position_m, rotation)
                };
                (shifted(STEP) - shifted(-STEP)) / (2.0 * STEP)
            }));
            for component in 0..6 {
                let shifted = |by: f64| {
                    let unit = Vec3::ith(component % 3, by);
                    if component < 3 {
                        loop_closure(&config, leg, q, position_m + unit, rotation)
                    } else {
                        loop_closure(&config, leg, q, position_m, turned(rotation, unit))
                    }
                };
                let per_twist = (shifted(STEP) - shifted(-STEP)) / (2.0 * STEP);
                let rates = per_joint.lu().solve(&-per_twist).unwrap();
                let shared = [
                    jacobian.actuators[(leg, component)],
                    jacobian.actuators[(LEGS + leg, component)],
                    jacobian.hinges[(leg, component)],
                ];
                for (rate, shared) in rates.iter().zip(shared) {
                    prop_assert!((rate - shared).abs() < 1e-7, "leg {leg}, twist {component}: {rate}, {shared}");
                }
            }
        }
    }
}

/// A chewing motion from a multibody simulation of the default mechanism.
#[test]
fn a_multibody_simulation_has_the_same_joints_and_rates() {
    let text = include_str!("data/reference_chewing.csv");
    let rows: Vec<Vec<f64>> = text
        .lines()
        .filter(|line| !line.starts_with(['#', 't']))
        .map(|line| line.split(',').map(|value| value.parse().unwrap()).collect())
        .collect();
    let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
    let pose_of = |row: &[f64]| pose(Vec3::new(row[1], row[2], row[3]), [row[4], row[5], row[6], row[7]]);
    let mut fastest_m_s: f64 = 0.0;
    assert_eq!(rows.len(), 60);
    for rows in rows.chunks(3) {
        let [before, now, after] = [0, 1, 2].map(|index| (rows[index][0], pose_of(&rows[index])));
        let joints = mechanism.inverse(&now.1).unwrap();
        for (axis, value_m) in joints.actuators.to_axes().into_iter().enumerate() {
            assert!((value_m - rows[1][8 + axis]).abs() < 2e-9, "axis {axis} at {} s", now.0);
        }
        let span_s = after.0 - before.0;
        let velocity = (after.1.translation.vector - before.1.translation.vector) / span_s;
        let angular = (after.1.rotation * before.1.rotation.inverse()).scaled_axis() / span_s;
        let rates = Jacobian::new(&mechanism, &now.1, &joints).actuators
            * nalgebra::Vector6::new(velocity.x, velocity.y, velocity.z, angular.x, angular.y, angular.z);
        for (axis, rate_m_s) in rates.iter().enumerate() {
            let known_m_s = rows[1][14 + axis];
            fastest_m_s = fastest_m_s.max(known_m_s.abs());
            assert!(
                (rate_m_s - known_m_s).abs() < 1e-4,
                "axis {axis} at {} s: {rate_m_s}, {known_m_s}",
                now.0
            );
        }
    }
    assert!(fastest_m_s > 0.05, "the sample hardly moves: {fastest_m_s} m/s");
}
