//! Forward kinematics cycle by cycle: warm from the last solution, proven, and complete when not.
//!
//! A warm result is accepted only under these conditions:
//! - Newton's iteration ended within `WARM_ITERATIONS`.
//! - The result's [`Certificate`](super::Certificate) holds.
//! - The mechanism can stand there.
//! - The result continues the last solution: each of the two lies in the other's ball of uniqueness, which
//!   contains no second solution of its input.
//!
//! In every other case the complete method decides. So the guess only saves time; it cannot make the result
//! wrong.

use masseter_model::geometry::{Actuators, LEGS, Mechanism};

use super::complete::choose;
use super::leg_angle::{Anchor, LegAngle};
use super::legs::each;
use super::loop_equations::LoopEquations;
use super::loop_solutions::check;
use super::{ForwardError, Solution};

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
    /// A tracker without a solution yet.
    pub fn new(mechanism: Mechanism) -> Self {
        Self { mechanism, last: None, anchor: Anchor::nowhere() }
    }

    /// A tracker that takes leg angles (radians) from elsewhere for its last solution. Good ones save
    /// the first cycle the complete method, and settle an ambiguous input; bad ones cost time only.
    pub fn with_guess(mechanism: Mechanism, theta_rad: [f64; LEGS]) -> Self {
        Self { mechanism, last: Some(Last::guessed(theta_rad)), anchor: Anchor::nowhere() }
    }

    /// The true solution for this input, certified. The last accepted solution outlives a failure.
    ///
    /// # Errors
    /// Those of [`solve_completely`](super::solve_completely).
    pub fn update(&mut self, actuators: &Actuators) -> Result<Solution, ForwardError> {
        check(actuators)?;
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
    fn guessed(theta_rad: [f64; LEGS]) -> Self {
        Self { leg_angles: theta_rad.map(LegAngle::from_rad), theta_rad, unique_within_rad: f64::INFINITY }
    }

    #[inline]
    fn solved(solution: &Solution) -> Self {
        let unique_within_rad = solution.certificate.map_or(0.0, |proof| proof.unique_within_rad);
        Self { leg_angles: solution.leg_angles, theta_rad: solution.theta_rad, unique_within_rad }
    }

    /// The true solution that continues this one, if the iteration finds and proves it.
    #[inline]
    fn continued(&self, loops: &LoopEquations<'_>, anchor: &mut Anchor) -> Option<Solution> {
        let closed = loops.close(&self.leg_angles, WARM_ITERATIONS)?;
        let theta_rad = anchor.angles_rad(&closed.leg_angles);
        let solution = Solution::with_angles(loops, &closed, theta_rad);
        let reach_rad = solution.certificate?.unique_within_rad.min(self.unique_within_rad);
        (self.is_within(reach_rad, &solution) && solution.assembly.is_true()).then_some(solution)
    }

    /// Angles on either side of ±π count as far apart, which costs time and nothing else.
    #[inline]
    fn is_within(&self, reach_rad: f64, solution: &Solution) -> bool {
        each(|leg| (solution.theta_rad[leg] - self.theta_rad[leg]).abs() < reach_rad) == [true; LEGS]
    }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Pose;
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::solve_completely;
    use crate::kinematics::tests::{angle_between, published_mechanism};

    /// A loop through the workspace like a fast chewing cycle, 1 kHz.
    fn on_the_loop(cycle: u32) -> Pose {
        let phase = f64::from(cycle) / 460.0 * std::f64::consts::TAU;
        let (sin, cos) = phase.sin_cos();
        Pose::from_parts(
            Translation3::new(0.005 * sin, 0.004 * cos, 0.27 + 0.01 * cos),
            UnitQuaternion::from_euler_angles(0.05 * sin, 0.15 + 0.15 * cos, 0.05 * cos),
        )
    }

    /// Mostly inputs within the strokes, but any axis may be any number.
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

        /// Whatever the guess, also one that is no number: the same answer as without one.
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

        /// Whatever came before: what an input alone does not settle, the last solution may.
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
}
