//! Forward kinematics cycle by cycle: warm from the last solution with a proof, otherwise complete.
//!
//! A warm result is accepted only under these conditions:
//! - Newton's iteration ended within `WARM_ITERATIONS`.
//! - The result's [`Certificate`](super::Certificate) holds.
//! - The mechanism can stand there.
//! - The result continues the last solution: each of the two lies in the other's ball of uniqueness, which
//!   contains no second solution of its input.
//!
//! In every other case the complete method decides ([`solve_completely`]): the true solution among all, from the input
//! alone. So the guess only saves time, and cannot make the result wrong.

use masseter_model::geometry::{Actuators, LEGS, Mechanism};

use super::legs::{Anchor, LegAngle, each};
use super::solution::{Condition, ForwardError, Solution};
use super::solutions::{LoopSolutions, assembly, check_input, nearest_other_rad};
use super::{elimination::SolutionFilter, loop_equations::LoopEquations};

/// Newton's iterations from the last solution; a chewing jaw takes 2 or 3 a millisecond.
const WARM_ITERATIONS: u32 = 4;

/// Solves a stream of inputs, each from the last accepted solution.
///
/// ```
/// use masseter_controller::kinematics::ForwardTracker;
/// use masseter_model::geometry::{Actuators, Mechanism, MechanismConfig};
///
/// let mut tracker = ForwardTracker::new(Mechanism::new(&MechanismConfig::default())?);
/// for step in 0..10 {
///     let leg_m = 0.27 + 1e-4 * f64::from(step);
///     let solution = tracker.update(&Actuators { slide_m: [0.0; 3], leg_m: [leg_m; 3] })?;
///     assert!(solution.certificate.is_some_and(|proof| proof.exists_within_rad < 1e-11));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[doc(alias("direct kinematics", "FK"))]
#[derive(Debug, Clone)]
pub struct ForwardTracker {
    mechanism: Mechanism,
    last: Option<Last>,
    anchor: Anchor,
}

/// The last accepted solution.
#[derive(Debug, Clone, Copy)]
struct Last {
    leg_angles: [LegAngle; LEGS],
    theta_rad: [f64; LEGS],
    unique_within_rad: f64,
}

impl ForwardTracker {
    /// A tracker without a solution.
    pub fn new(mechanism: Mechanism) -> Self {
        Self { mechanism, last: None, anchor: Anchor::nowhere() }
    }

    /// A tracker with given leg angles (radians) as its last solution. Good angles save the complete method in the
    /// first cycle, and settle an ambiguous input; bad angles cost time only.
    pub fn with_guess(mechanism: Mechanism, theta_rad: [f64; LEGS]) -> Self {
        let leg_angles = theta_rad.map(LegAngle::from_rad);
        let last = Some(Last { leg_angles, theta_rad, unique_within_rad: f64::INFINITY });
        Self { last, ..Self::new(mechanism) }
    }

    /// The true solution for this input, certified. The last accepted solution outlives a failure.
    ///
    /// # Errors
    /// Those of [`solve_completely`].
    pub fn update(&mut self, actuators: &Actuators) -> Result<Solution, ForwardError> {
        check_input(actuators)?;
        let loops = LoopEquations::new(&self.mechanism, actuators);
        let continued = self.last.as_ref().and_then(|last| last.continued(&loops, &mut self.anchor));
        let solution = match continued {
            Some(solution) => solution,
            None => choose(&loops)?,
        };
        self.last = Some(Last::solved(&solution));
        Ok(solution)
    }
}

impl Last {
    #[inline]
    fn solved(solution: &Solution) -> Self {
        let unique_within_rad = solution.certificate.map_or(0.0, |proof| proof.unique_within_rad);
        Self { leg_angles: solution.leg_angles, theta_rad: solution.theta_rad, unique_within_rad }
    }

    /// The true solution that continues this one, if the iteration finds and proves a solution.
    #[inline]
    fn continued(&self, loops: &LoopEquations<'_>, anchor: &mut Anchor) -> Option<Solution> {
        let closed = loops.close(&self.leg_angles, WARM_ITERATIONS)?;
        let theta_rad = anchor.angles_rad(&closed.leg_angles);
        let solution = Solution::with_angles(loops, &closed, theta_rad);
        let reach_rad = solution.certificate?.unique_within_rad.min(self.unique_within_rad);
        (self.is_within(reach_rad, &solution) && solution.assembly.is_true()).then_some(solution)
    }

    /// Angles on either side of ±π count as far apart, which costs only time.
    #[inline]
    fn is_within(&self, reach_rad: f64, solution: &Solution) -> bool {
        each(|leg| (solution.theta_rad[leg] - self.theta_rad[leg]).abs() < reach_rad) == [true; LEGS]
    }
}

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
/// [`ForwardError::NotFinite`] and [`ForwardError::NoLength`] for an invalid input. [`ForwardError::Unassemblable`]
/// without any solution, [`ForwardError::WrongAssembly`] without a true solution, [`ForwardError::Ambiguous`] with more
/// than one. [`ForwardError::Singular`] and [`ForwardError::Undecided`] where solutions meet or rounding is too large
/// for a certificate.
#[doc(alias("direct kinematics", "forward kinematics", "FK"))]
pub fn solve_completely(mechanism: &Mechanism, actuators: &Actuators) -> Result<Solution, ForwardError> {
    check_input(actuators)?;
    choose(&LoopEquations::new(mechanism, actuators))
}

fn choose(loops: &LoopEquations<'_>) -> Result<Solution, ForwardError> {
    only_true_one(loops).map_or_else(|| judged(loops), Ok)
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

/// Distance of the nearest two true solutions, radians.
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
    use masseter_model::geometry::Pose;
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{
        AMBIGUOUS, NearlySingular, angle_between, mechanisms, nearly_singular, poses, published_mechanism,
    };
    use crate::kinematics::{Assembly, Method, Options, Solutions, solve};

    /// A loop through the workspace like a fast chewing cycle, 1 kHz.
    fn on_the_loop(cycle: u32) -> Pose {
        let phase = f64::from(cycle) / 460.0 * std::f64::consts::TAU;
        let (sin, cos) = phase.sin_cos();
        Pose::from_parts(
            Translation3::new(0.005 * sin, 0.004 * cos, 0.27 + 0.01 * cos),
            UnitQuaternion::from_euler_angles(0.05 * sin, 0.15 + 0.15 * cos, 0.05 * cos),
        )
    }

    /// Mostly inputs within the strokes; any axis may be any number.
    fn any_numbers() -> impl Strategy<Value = Actuators> {
        let or_any = |low: f64, high: f64| prop_oneof![30 => low..high, 1 => prop::num::f64::ANY];
        let axes = (prop::array::uniform3(or_any(-0.03, 0.03)), prop::array::uniform3(or_any(0.24, 0.3)));
        axes.prop_map(|(slide_m, leg_m)| Actuators { slide_m, leg_m })
    }

    #[test]
    fn a_moving_platform_is_followed_in_two_or_three_iterations_a_cycle() {
        let mechanism = published_mechanism();
        let mut tracker = ForwardTracker::new(mechanism.clone());
        for cycle in 0..460 {
            let pose = on_the_loop(cycle);
            let solution = tracker.update(&mechanism.inverse(&pose).unwrap().actuators).unwrap();
            assert!((solution.pose.translation.vector - pose.translation.vector).norm() < 1e-10);
            assert!(angle_between(&solution.pose, &pose) < 1e-10);
            assert!(solution.iterations <= 3);
        }
    }

    #[test]
    fn a_bad_input_leaves_the_tracker_where_it_was() {
        let mechanism = published_mechanism();
        let good = mechanism.inverse(&on_the_loop(0)).unwrap().actuators;
        let mut tracker = ForwardTracker::new(mechanism);
        tracker.update(&good).unwrap();
        let broken = Actuators { leg_m: [f64::NAN, 0.27, 0.27], ..good };
        assert_eq!(tracker.update(&broken), Err(ForwardError::NotFinite));
        assert_eq!(tracker.update(&good).unwrap().iterations, 0);
    }

    #[test]
    fn a_jump_or_a_false_last_solution_is_solved_cold() {
        let mechanism = published_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let inverted = [71.291_703_191_386_5_f64.to_radians(); LEGS];
        let mut tracker = ForwardTracker::with_guess(mechanism.clone(), inverted);
        let upright = tracker.update(&neutral).unwrap();
        assert!(
            upright.theta_rad.iter().all(|angle_rad| (angle_rad.to_degrees() - 83.862_391_93).abs() < 1e-7)
        );
        let far = mechanism.inverse(&on_the_loop(230)).unwrap();
        let found = tracker.update(&far.actuators).unwrap();
        for leg in 0..LEGS {
            assert!((found.theta_rad[leg] - far.theta_rad[leg]).abs() < 1e-10);
        }
        assert!((found.pose.translation.vector - on_the_loop(230).translation.vector).norm() < 1e-10);
        assert!(angle_between(&found.pose, &on_the_loop(230)) < 1e-10);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Every guess, also one that is no number, gives the same answer as no guess.
        #[test]
        fn no_guess_makes_the_result_wrong(
            slide_m in prop::array::uniform3(-0.03..0.03f64),
            leg_m in prop::array::uniform3(0.24..0.3f64),
            guess in prop::array::uniform3(prop_oneof![9 => -4.0..4.0f64, 1 => prop::num::f64::ANY]),
        ) {
            let (mechanism, actuators) = (published_mechanism(), Actuators { slide_m, leg_m });
            let alone = solve_completely(&mechanism, &actuators);
            match (alone, ForwardTracker::with_guess(mechanism, guess).update(&actuators)) {
                (Ok(alone), Ok(guessed)) => {
                    for leg in 0..LEGS {
                        prop_assert!((alone.theta_rad[leg] - guessed.theta_rad[leg]).abs() < 1e-9);
                    }
                }
                (alone, guessed) => prop_assert_eq!(alone, guessed),
            }
        }

        /// For every history: the last solution may settle an input that is ambiguous alone.
        #[test]
        fn any_numbers_end_in_what_they_mean_alone(inputs in prop::collection::vec(any_numbers(), 3)) {
            let mut tracker = ForwardTracker::new(published_mechanism());
            for actuators in inputs {
                match (tracker.update(&actuators), solve_completely(&published_mechanism(), &actuators)) {
                    (Ok(tracked), Ok(alone)) => {
                        for leg in 0..LEGS {
                            prop_assert!((tracked.theta_rad[leg] - alone.theta_rad[leg]).abs() < 1e-9);
                        }
                    }
                    (Ok(_), Err(error)) => prop_assert_eq!(error.reason(), "ambiguous"),
                    (tracked, alone) => prop_assert_eq!(tracked, alone),
                }
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// The test goes up to the singularity, where the true solution and another are not separable.
        #[test]
        fn no_true_solution_is_called_a_wrong_assembly(singular in nearly_singular()) {
            let NearlySingular { mechanism, joints, determinant } = singular;
            let standing = Assembly::new(&mechanism, &joints.actuators, &joints.theta_rad);
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
                    let standing = Assembly::new(&mechanism, &joints.actuators, &joints.theta_rad);
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
