//! A million random poses to actuators and back, without a guess, from a random guess, and from a near guess:
//! `cargo run --release -p masseter-controller --example round_trip -- 1000000`.

use std::error::Error;
use std::f64::consts::PI;

use masseter_controller::kinematics::{Assembly, ForwardError, ForwardTracker, Solution, solve_completely};
use masseter_model::geometry::{Mechanism, MechanismConfig, Pose, Vec3};
use nalgebra::{Translation3, UnitQuaternion};

/// Turns about each axis reach this far.
const TURN_RAD: f64 = PI / 6.0;

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

/// The results of a method over all poses.
#[derive(Default)]
struct Score {
    reached: u32,
    worst_m: f64,
    worst_rad: f64,
}

impl Score {
    /// Counts a pose as reached within 10⁻⁹ m and rad of the true pose.
    fn add(&mut self, solved: Result<Solution, ForwardError>, pose: &Pose) {
        let Ok(solution) = solved else { return };
        let (error_m, error_rad) = errors(&solution.pose, pose);
        self.reached += u32::from(error_m.max(error_rad) < 1e-9 && solution.certificate.is_some());
        (self.worst_m, self.worst_rad) = (self.worst_m.max(error_m), self.worst_rad.max(error_rad));
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let wanted: u32 = std::env::args().nth(1).map_or(Ok(100_000), |count| count.parse())?;
    let mechanism = Mechanism::new(&MechanismConfig::default())?;
    let names = ["without a guess", "from a random guess", "from a near guess"];
    let mut scores: [Score; 3] = Default::default();
    let (mut state, mut done, mut drawn) = (1, 0, 0);
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
        let anywhere = std::array::from_fn(|_| PI * random(&mut state));
        let near = joints.theta_rad.map(|theta| theta + 1e-4);
        let from = |guess| ForwardTracker::with_guess(mechanism.clone(), guess).update(&actuators);
        let solved = [solve_completely(&mechanism, &actuators), from(anywhere), from(near)];
        for (score, solved) in scores.iter_mut().zip(solved) {
            score.add(solved, &pose);
        }
    }
    println!("{done} feasible poses of {drawn} drawn");
    for (name, Score { reached, worst_m, worst_rad }) in names.iter().zip(&scores) {
        println!("{name:20} reached {reached}, largest errors {worst_m:.2e} m, {worst_rad:.2e} rad");
    }
    let all_reached = scores.iter().all(|score| score.reached == done);
    all_reached.then_some(()).ok_or_else(|| "some poses were not reached".into())
}
