//! Solving without a previous solution: a fixed list of starts, of which the first true solution wins.
//!
//! The first start is nearly always enough: for a level platform the slides alone fix its place and
//! yaw in closed form, the legs' lengths then its height and tilt. It led to each of 160 000 poses
//! turned by up to 45° about every axis. A list is no proof, though: of 400 000 inputs drawn from the
//! box of strokes, 81 % were solved, all but about 30 from the first start, and sixty random starts
//! for each of the others found 8 more.

use masseter_shared::geometry::{Actuators, LEGS, Mechanism, Vec3};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::{ForwardError, Method, Options, Solution, solve};

/// Rounds in which the estimate of the tilt corrects the estimate of place and yaw.
const TILT_ROUNDS: usize = 3;
/// Starts around the estimate, radians on the three legs.
const OFFSETS_RAD: [[f64; LEGS]; 8] = [
    [0.0; LEGS],
    [0.1; LEGS],
    [0.15, 0.0, 0.0],
    [0.0, 0.15, 0.0],
    [0.0, 0.0, 0.15],
    [0.0, 0.15, 0.15],
    [0.15, 0.0, 0.15],
    [0.15, 0.15, 0.0],
];

/// Solves one input on its own: the first true solution to which a start leads.
///
/// Each start is tried by the seed's algorithm, then by Newton–Raphson, which often passes the local
/// minimum in which the other stalls.
///
/// # Errors
/// [`ForwardError::WrongAssembly`] if only folded or mirrored solutions were found, else the error of
/// the first start.
pub fn solve_cold(
    mechanism: &Mechanism,
    actuators: &Actuators,
    options: &Options,
) -> Result<Solution, ForwardError> {
    if !actuators.is_finite() {
        return Err(ForwardError::NotFinite);
    }
    let estimate_rad = estimate(mechanism, actuators);
    let mut failure = None;
    for offset_rad in OFFSETS_RAD {
        let guess_rad = std::array::from_fn(|leg| estimate_rad[leg] + offset_rad[leg]);
        for method in [Method::Seed, Method::Newton] {
            match true_solution(method, mechanism, actuators, &guess_rad, options) {
                Ok(solution) => return Ok(solution),
                Err(error) => failure = Some(more_telling(failure, error)),
            }
        }
    }
    Err(failure.expect("at least one start was made"))
}

/// A solution from one start, refused unless it is a true one.
pub(super) fn true_solution(
    method: Method,
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: &[f64; LEGS],
    options: &Options,
) -> Result<Solution, ForwardError> {
    let solution = solve(method, mechanism, actuators, guess_rad, options)?;
    match solution.assembly.violated() {
        None => Ok(solution),
        Some(violated) => Err(ForwardError::WrongAssembly { violated }),
    }
}

/// A wrong assembly tells more than a start that led nowhere; else the first failure stands.
fn more_telling(earlier: Option<ForwardError>, error: ForwardError) -> ForwardError {
    match (earlier, error) {
        (None, error) => error,
        (Some(ForwardError::WrongAssembly { .. }), _) => earlier.unwrap_or(error),
        (Some(_), ForwardError::WrongAssembly { .. }) => error,
        (Some(earlier), _) => earlier,
    }
}

/// Leg angles of the platform that the slides place and the legs tilt, radians.
fn estimate(mechanism: &Mechanism, actuators: &Actuators) -> [f64; LEGS] {
    let mut tilt = UnitQuaternion::identity();
    let mut theta_rad = [0.0; LEGS];
    for _ in 0..TILT_ROUNDS {
        let arms = mechanism.platform_corners().map(|corner| tilt * corner);
        let corners = placed_by_slides(mechanism, actuators, &arms).unwrap_or(arms);
        theta_rad = std::array::from_fn(|leg| leg_angle(mechanism, actuators, leg, &corners[leg]));
        let normal = normal_of(&mechanism.corners_from_angles(actuators, &theta_rad));
        tilt = UnitQuaternion::rotation_between(&Vec3::z(), &normal).unwrap_or_default();
    }
    theta_rad
}

/// Corners above the base when the platform with these arms is shifted by (x, y) and turned a little
/// so that each stands across its slide: (p + ψ ẑ×aᵢ + aᵢ)·ûᵢ = Bᵢ·ûᵢ, linear in x, y and ψ.
fn placed_by_slides(
    mechanism: &Mechanism,
    actuators: &Actuators,
    arms: &[Vec3; LEGS],
) -> Option<[Vec3; LEGS]> {
    let mut rows = Matrix3::zeros();
    let mut wanted = Vector3::zeros();
    for leg in 0..LEGS {
        let along = mechanism.slide_direction(leg);
        let hinge = mechanism.hinge(leg, actuators.slide_m[leg]);
        rows.set_row(leg, &Vec3::new(along.x, along.y, along.dot(&Vec3::z().cross(&arms[leg]))).transpose());
        wanted[leg] = along.dot(&(hinge - arms[leg]));
    }
    let place = rows.lu().solve(&wanted)?;
    let yaw = UnitQuaternion::from_scaled_axis(Vec3::z() * place.z);
    Some(arms.map(|arm| yaw * arm + Vec3::new(place.x, place.y, 0.0)))
}

/// The angle at which a leg of this length stands under a corner, upright if it is too short.
fn leg_angle(mechanism: &Mechanism, actuators: &Actuators, leg: usize, corner: &Vec3) -> f64 {
    let hinge = mechanism.hinge(leg, actuators.slide_m[leg]);
    let reach_m = (corner - hinge).dot(&mechanism.inward_direction(leg));
    (reach_m / actuators.leg_m[leg]).clamp(-1.0, 1.0).acos()
}

fn normal_of(corners: &[Vec3; LEGS]) -> Vec3 {
    let [a1, a2, a3] = corners;
    (a2 - a1).cross(&(a3 - a1))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::samples::{angle_between, mechanisms, poses, seed_mechanism};

    /// Starts drawn at random, as a check on those in the list.
    fn reached_from_anywhere(mechanism: &Mechanism, actuators: &Actuators, guesses: &[[f64; LEGS]]) -> bool {
        let reaches =
            |guess| true_solution(Method::Newton, mechanism, actuators, guess, &Options::default()).is_ok();
        guesses.iter().any(reaches)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        #[test]
        fn a_pose_comes_back_from_its_actuators_alone(mechanism in mechanisms(), pose in poses(25.0)) {
            let joints = mechanism.inverse(&pose).unwrap();
            let solution = solve_cold(&mechanism, &joints.actuators, &Options::default()).unwrap();
            prop_assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
            prop_assert!(angle_between(&solution.pose, &pose) < 1e-10);
            prop_assert!(solution.iterations <= 8);
        }

        /// Over the whole box of strokes, one input in five has no true solution.
        #[test]
        fn a_failure_is_one_from_random_starts_too(
            axes in [-0.03..0.03f64, -0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64, 0.24..0.3f64, 0.24..0.3f64],
            guesses in prop::array::uniform32([0.7..2.4f64, 0.7..2.4f64, 0.7..2.4f64]),
        ) {
            let (mechanism, actuators) = (seed_mechanism(), Actuators::from_axes(axes));
            if solve_cold(&mechanism, &actuators, &Options::default()).is_err() {
                prop_assert!(!reached_from_anywhere(&mechanism, &actuators, &guesses));
            }
        }
    }

    #[test]
    fn what_cannot_be_assembled_and_what_is_no_number_are_told_apart() {
        let solve = |leg_m| {
            let actuators = Actuators { slide_m: [0.0; LEGS], leg_m };
            solve_cold(&seed_mechanism(), &actuators, &Options::default()).unwrap_err()
        };
        assert!(matches!(solve([0.30, 0.30, 0.20]).reason(), "stalled" | "no_convergence" | "singular"));
        assert_eq!(solve([0.27, f64::NAN, 0.27]), ForwardError::NotFinite);
    }
}
