//! The true solution among all, from the input alone.

use masseter_model::geometry::{Actuators, Mechanism};

use super::elimination::SolutionFilter;
use super::loop_equations::LoopEquations;
use super::loop_solutions::{LoopSolutions, assembly, check, nearest_other_rad};
use super::{Condition, ForwardError, Solution};

/// The one solution of an input in which the mechanism stands as it was assembled, with its certificate.
///
/// ```
/// use masseter_controller::kinematics::solve_completely;
/// use masseter_model::geometry::{Actuators, Mechanism, MechanismConfig};
///
/// let mechanism = Mechanism::new(&MechanismConfig::default())?;
/// let neutral = Actuators { slide_m: [0.0; 3], leg_m: [0.27; 3] };
/// let solution = solve_completely(&mechanism, &neutral)?;
/// assert!((solution.theta_rad[0].to_degrees() - 83.862).abs() < 1e-3);
/// assert!((solution.pose.translation.z - 0.268_452).abs() < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`ForwardError::NotFinite`] and [`ForwardError::NoLength`] for what is no input;
/// [`ForwardError::Unassemblable`] without any solution, [`ForwardError::WrongAssembly`] without a
/// true one, [`ForwardError::Ambiguous`] with more than one; [`ForwardError::Singular`] and
/// [`ForwardError::Undecided`] where solutions meet or rounding is too large for a certificate.
#[doc(alias("direct kinematics", "forward kinematics", "FK"))]
pub fn solve_completely(mechanism: &Mechanism, actuators: &Actuators) -> Result<Solution, ForwardError> {
    check(actuators)?;
    choose(&LoopEquations::new(mechanism, actuators))
}

pub(super) fn choose(loops: &LoopEquations<'_>) -> Result<Solution, ForwardError> {
    match only_true_one(loops) {
        Some(solution) => Ok(solution),
        None => judged(loops),
    }
}

/// The only true solution, as nearly every input has it. Other solutions are not followed, so a failure has no reason.
fn only_true_one(loops: &LoopEquations<'_>) -> Option<Solution> {
    let solutions = LoopSolutions::find(loops, SolutionFilter::PositiveDeterminant).ok()?;
    let mut true_ones = solutions.true_ones(loops);
    let solution = Solution::new(loops, true_ones.next()?);
    let is_sure = solution.certificate.is_some() && solutions.singular_one(loops).is_none();
    (true_ones.next().is_none() && is_sure).then_some(solution)
}

fn judged(loops: &LoopEquations<'_>) -> Result<Solution, ForwardError> {
    let solutions = LoopSolutions::find(loops, SolutionFilter::All)?;
    let mut true_ones = solutions.true_ones(loops);
    match (true_ones.next(), true_ones.count(), solutions.singular_one(loops)) {
        (Some(_), others @ 1.., _) => Err(ForwardError::Ambiguous {
            count: 1 + others,
            separation_rad: separation_rad(loops, &solutions),
        }),
        (_, _, Some(closed)) => Err(ForwardError::Singular {
            determinant: loops.determinant(&closed.residuals),
            residual_m: loops.residual_m(&closed.residuals),
        }),
        (Some(closed), ..) => {
            let solution = Solution::new(loops, closed);
            // On a mechanism of extreme dimensions rounding may hide even a regular solution.
            let undecided = ForwardError::Undecided { solutions: solutions.count };
            if solution.certificate.is_some() { Ok(solution) } else { Err(undecided) }
        }
        (None, ..) => Err(match nearly_true(loops, &solutions) {
            Some(violated) => ForwardError::WrongAssembly { violated },
            None => ForwardError::Unassemblable,
        }),
    }
}

/// How far the nearest two of the true ones are apart, radians.
fn separation_rad(loops: &LoopEquations<'_>, solutions: &LoopSolutions) -> f64 {
    let true_ones = || solutions.true_ones(loops).map(|closed| &closed.leg_angles);
    let nearest = true_ones().filter_map(|leg_angles| nearest_other_rad(leg_angles, true_ones()));
    nearest.min_by(f64::total_cmp).unwrap_or(0.0)
}

/// The condition at which the last of the solutions failed.
fn nearly_true(loops: &LoopEquations<'_>, solutions: &LoopSolutions) -> Option<Condition> {
    solutions.iter().filter_map(|closed| assembly(loops, closed).violated()).max()
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::LEGS;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{
        AMBIGUOUS, NearlySingular, angle_between, mechanisms, nearly_singular, poses, published_mechanism,
    };
    use crate::kinematics::{Method, Options, Solutions, solve};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// Up to the singularity, where the true solution and another can no longer be separated.
        #[test]
        fn no_true_solution_is_called_a_wrong_assembly(singular in nearly_singular()) {
            let NearlySingular { mechanism, joints, determinant } = singular;
            let standing = super::super::Assembly::new(&mechanism, &joints.actuators, &joints.theta_rad);
            if !standing.is_true() {
                return Ok(());
            }
            match solve_completely(&mechanism, &joints.actuators) {
                Ok(solution) => prop_assert!(joints.theta_rad.iter().zip(solution.theta_rad).all(|(a, b)| (a - b).abs() < 1e-6)),
                Err(ForwardError::Ambiguous { .. }) => {}
                Err(error) => prop_assert!(error.reason() == "singular" && determinant < 1e-5, "{error}"),
            }
        }

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
            let from = |guess| solve(Method::Newton, &mechanism, &actuators, guess, &Options::default());
            for found in guesses.iter().filter_map(|guess| from(guess).ok()) {
                prop_assert!(error != ForwardError::Unassemblable);
                let none_is_true = matches!(error, ForwardError::WrongAssembly { .. });
                prop_assert!(!(none_is_true && found.assembly.is_true()), "{error}");
            }
        }
    }

    /// Each of the two has a wrong solution nearer than the other true one.
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

    /// The true solution lies 1.3·10⁻⁵ rad from another.
    #[test]
    fn a_true_solution_next_to_a_singularity_is_no_wrong_assembly() {
        let actuators = Actuators {
            slide_m: [-0.024_960_023_256_180_783, -0.019_226_737_730_943_216, -0.027_995_734_854_166_104],
            leg_m: [0.247_840_170_146_961_3, 0.241_913_748_868_673_84, 0.275_213_645_808_134_73],
        };
        let solution = solve_completely(&published_mechanism(), &actuators).unwrap();
        for (found, known) in solution.theta_rad.into_iter().zip([1.289_906_3, 1.381_370_4, 1.374_701_5]) {
            assert!((found - known).abs() < 1e-7);
        }
        assert!((solution.determinant - 3.0e-5).abs() < 0.1e-5);
    }

    #[test]
    fn each_kind_of_failure_has_its_own_error() {
        let failure = |leg_m| {
            let actuators = Actuators { slide_m: [0.0; LEGS], leg_m };
            solve_completely(&published_mechanism(), &actuators).unwrap_err()
        };
        assert_eq!(failure([0.30, 0.30, 0.20]), ForwardError::Unassemblable);
        assert_eq!(failure([0.27, f64::NAN, 0.27]), ForwardError::NotFinite);
        assert_eq!(failure([0.27, 0.27, -0.27]), ForwardError::NoLength { leg: 2, leg_m: -0.27 });
    }
}
