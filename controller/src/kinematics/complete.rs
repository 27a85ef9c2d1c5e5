//! The true solution among all: what is right when nothing is known but the input.

use masseter_shared::geometry::{Actuators, Mechanism};

use super::closure::Closure;
use super::elimination::Wanted;
use super::platforms::{Platforms, assembly, check, nearest_other_rad};
use super::{Condition, ForwardError, Solution};

/// The one solution of an input in which the mechanism stands as it was assembled, certified.
///
/// # Errors
/// [`ForwardError::NotFinite`] and [`ForwardError::NoLength`] for what is no input;
/// [`ForwardError::Unassemblable`] without any solution, [`ForwardError::WrongAssembly`] without a
/// true one, [`ForwardError::Ambiguous`] with more than one; [`ForwardError::Singular`] and
/// [`ForwardError::Undecided`] where solutions meet.
pub fn solve_completely(mechanism: &Mechanism, actuators: &Actuators) -> Result<Solution, ForwardError> {
    check(actuators)?;
    choose(&Closure::new(mechanism, actuators))
}

pub(super) fn choose(closure: &Closure<'_>) -> Result<Solution, ForwardError> {
    match only_true_one(closure) {
        Some(solution) => Ok(solution),
        None => judged(closure),
    }
}

/// What nearly every input has. Only true ones are looked for, so it does not tell why there is none.
fn only_true_one(closure: &Closure<'_>) -> Option<Solution> {
    let platforms = Platforms::of(closure, Wanted::PositiveDeterminant).ok()?;
    let mut true_ones = platforms.true_ones(closure);
    let solution = Solution::new(closure, true_ones.next()?);
    (true_ones.next().is_none() && solution.certificate.is_some()).then_some(solution)
}

fn judged(closure: &Closure<'_>) -> Result<Solution, ForwardError> {
    let platforms = Platforms::of(closure, Wanted::All)?;
    let mut true_ones = platforms.true_ones(closure);
    match (true_ones.next(), true_ones.count()) {
        (Some(closed), 0) => certified(&Solution::new(closure, closed)),
        (Some(_), others) => Err(ForwardError::Ambiguous {
            count: 1 + others,
            separation_rad: separation_rad(closure, &platforms),
        }),
        (None, _) => Err(match nearly_true(closure, &platforms) {
            Some(violated) => ForwardError::WrongAssembly { violated },
            None => ForwardError::Unassemblable,
        }),
    }
}

/// How far the nearest two of the true ones are apart, radians.
fn separation_rad(closure: &Closure<'_>, platforms: &Platforms) -> f64 {
    let true_ones = || platforms.true_ones(closure).map(|closed| &closed.headings);
    let nearest = true_ones().filter_map(|headings| nearest_other_rad(headings, true_ones()));
    nearest.min_by(f64::total_cmp).unwrap_or(0.0)
}

fn certified(solution: &Solution) -> Result<Solution, ForwardError> {
    let Solution { determinant, residual_m, .. } = *solution;
    solution.certificate.map(|_| *solution).ok_or(ForwardError::Singular { determinant, residual_m })
}

/// The condition at which the last of the solutions failed.
fn nearly_true(closure: &Closure<'_>, platforms: &Platforms) -> Option<Condition> {
    platforms.iter().filter_map(|closed| assembly(closure, closed).violated()).max()
}

#[cfg(test)]
mod tests {
    use masseter_shared::geometry::LEGS;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::samples::{AMBIGUOUS, angle_between, mechanisms, poses, published_mechanism};
    use crate::kinematics::{Options, Solutions, solve_newton};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        #[test]
        fn a_pose_comes_back_from_its_actuators_alone(mechanism in mechanisms(), pose in poses(30.0)) {
            let joints = mechanism.inverse(&pose).unwrap();
            match solve_completely(&mechanism, &joints.actuators) {
                Ok(solution) => {
                    prop_assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
                    prop_assert!(angle_between(&solution.pose, &pose) < 1e-10);
                }
                // Poses of this range may stand beyond a singularity, where they are not true.
                Err(error) => {
                    let standing = super::super::Assembly::new(&mechanism, &joints.actuators, &joints.theta_rad);
                    prop_assert!(!standing.is_true(), "{error}");
                }
            }
        }

        /// Over the whole box of strokes, one input in five has no true solution; a rare one has two.
        #[test]
        fn a_failure_is_one_from_random_starts_too(
            slide_m in prop::array::uniform3(-0.03..0.03f64), leg_m in prop::array::uniform3(0.24..0.3f64),
            guesses in prop::array::uniform32([0.7..2.4f64, 0.7..2.4f64, 0.7..2.4f64]),
        ) {
            let (mechanism, actuators) = (published_mechanism(), Actuators { slide_m, leg_m });
            let Err(error) = solve_completely(&mechanism, &actuators) else { return Ok(()) };
            let from = |guess| solve_newton(&mechanism, &actuators, guess, &Options::default());
            for found in guesses.iter().filter_map(|guess| from(guess).ok()) {
                prop_assert!(error != ForwardError::Unassemblable);
                let none_is_true = matches!(error, ForwardError::WrongAssembly { .. });
                prop_assert!(!(none_is_true && found.assembly.is_true()), "{error}");
            }
        }
    }

    /// Wrong solutions stand nearer to each of the two.
    #[test]
    fn an_ambiguous_input_says_how_far_its_true_solutions_are_apart() {
        let all = Solutions::new(&published_mechanism(), &AMBIGUOUS).unwrap();
        let [Some(one), Some(other), None] = [0, 1, 2].map(|index| all.true_ones().nth(index)) else {
            panic!()
        };
        let apart_rad =
            (0..LEGS).map(|leg| (one.theta_rad[leg] - other.theta_rad[leg]).abs()).fold(0.0, f64::max);
        assert!(all.separation_rad(one).unwrap() < 0.9 * apart_rad);
        let error = solve_completely(&published_mechanism(), &AMBIGUOUS).unwrap_err();
        let ForwardError::Ambiguous { count: 2, separation_rad } = error else { panic!("{error}") };
        assert!((separation_rad - apart_rad).abs() < 1e-9, "{separation_rad}, not {apart_rad}");
    }

    #[test]
    fn each_kind_of_failure_is_told_apart() {
        let failure = |leg_m| {
            let actuators = Actuators { slide_m: [0.0; LEGS], leg_m };
            solve_completely(&published_mechanism(), &actuators).unwrap_err()
        };
        assert_eq!(failure([0.30, 0.30, 0.20]), ForwardError::Unassemblable);
        assert_eq!(failure([0.27, f64::NAN, 0.27]), ForwardError::NotFinite);
        assert_eq!(failure([0.27, 0.27, -0.27]), ForwardError::NoLength { leg: 2, leg_m: -0.27 });
    }
}
