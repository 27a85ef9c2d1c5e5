//! A million random poses to actuators and back, from the actuators alone and from the last pose:
//! `cargo run --release -p masseter-controller --example round_trip -- 1000000`.

use std::error::Error;

use masseter_controller::kinematics::{Assembly, ForwardTracker, solve_completely};
use masseter_shared::geometry::{Mechanism, MechanismConfig, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};

/// Turns about each axis reach this far.
const TURN_RAD: f64 = std::f64::consts::PI / 6.0;

/// Vigna's and Steele's splitmix64, as a number in [−1, 1).
fn random(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

fn pose(state: &mut u64) -> Pose {
    let [x, y, z, roll, pitch, yaw] = std::array::from_fn(|_| random(state));
    Pose::from_parts(
        Translation3::new(0.03 * x, 0.03 * y, 0.27 + 0.03 * z),
        UnitQuaternion::from_euler_angles(TURN_RAD * roll, TURN_RAD * pitch, TURN_RAD * yaw),
    )
}

/// Distance (m) and angle (rad) between two poses.
fn errors(found: &Pose, pose: &Pose) -> (f64, f64) {
    let turn: Vec3 = (found.rotation.inverse() * pose.rotation).scaled_axis();
    ((found.translation.vector - pose.translation.vector).norm(), turn.norm())
}

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: u32 = std::env::args().nth(1).map_or(Ok(100_000), |count| count.parse())?;
    let mechanism = Mechanism::new(&MechanismConfig::default())?;
    let (mut state, mut worst_m, mut worst_rad, mut done, mut drawn) = (1, 0.0f64, 0.0f64, 0, 0);
    while done < wanted {
        drawn += 1;
        let pose = pose(&mut state);
        let joints = mechanism.inverse(&pose)?;
        let actuators = joints.actuators;
        let standing = Assembly::new(&mechanism, &actuators, &joints.theta_rad).is_true();
        if !standing || mechanism.strokes().check(&actuators).is_err() {
            continue;
        }
        done += 1;
        let near = joints.theta_rad.map(|theta| theta + 1e-4);
        let warm = ForwardTracker::with_guess(mechanism.clone(), near).update(&actuators);
        for solution in [solve_completely(&mechanism, &actuators), warm] {
            let solution = solution.map_err(|error| format!("{pose}: {error}"))?;
            let (error_m, error_rad) = errors(&solution.pose, &pose);
            (worst_m, worst_rad) = (worst_m.max(error_m), worst_rad.max(error_rad));
        }
    }
    println!(
        "{done} poses of {drawn} drawn are feasible; largest errors {worst_m:.2e} m, {worst_rad:.2e} rad"
    );
    Ok(())
}
