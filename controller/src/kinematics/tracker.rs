//! Forward kinematics cycle by cycle, each solution the guess for the next.

use masseter_shared::geometry::{Actuators, LEGS, Mechanism};

use super::cold::true_solution;
use super::{ForwardError, Method, Options, Solution, solve_cold};

/// Solves a stream of inputs, each from the last accepted solution.
#[derive(Debug, Clone)]
pub struct ForwardTracker {
    mechanism: Mechanism,
    method: Method,
    options: Options,
    last_rad: Option<[f64; LEGS]>,
}

impl ForwardTracker {
    /// A tracker that knows no solution yet, with the seed's algorithm.
    pub fn new(mechanism: Mechanism) -> Self {
        Self::with(mechanism, Method::Seed, Options::default())
    }

    /// A tracker with another iteration for its warm starts.
    pub fn with(mechanism: Mechanism, method: Method, options: Options) -> Self {
        Self { mechanism, method, options, last_rad: None }
    }

    /// The leg angles of the last accepted solution, radians.
    pub fn last_theta_rad(&self) -> Option<[f64; LEGS]> {
        self.last_rad
    }

    /// Forgets the last solution, so that the next input is solved cold.
    pub fn reset(&mut self) {
        self.last_rad = None;
    }

    /// The true solution for this input, in a bounded number of iterations.
    ///
    /// Tries the last accepted solution as the guess, then the starts of [`solve_cold`]. The last
    /// accepted solution outlives a failure.
    ///
    /// # Errors
    /// Those of [`solve_cold`].
    pub fn update(&mut self, actuators: &Actuators) -> Result<Solution, ForwardError> {
        let warm = self.last_rad.and_then(|guess_rad| {
            true_solution(self.method, &self.mechanism, actuators, &guess_rad, &self.options).ok()
        });
        let solution = match warm {
            Some(solution) => solution,
            None => solve_cold(&self.mechanism, actuators, &self.options)?,
        };
        self.last_rad = Some(solution.theta_rad);
        Ok(solution)
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::geometry::Pose;
    use nalgebra::{Translation3, UnitQuaternion};

    use super::*;
    use crate::kinematics::samples::{angle_between, seed_mechanism};

    /// A loop through the workspace like a fast chewing cycle, 1 kHz.
    fn on_the_loop(cycle: u32) -> Pose {
        let phase = f64::from(cycle) / 460.0 * std::f64::consts::TAU;
        let (sin, cos) = phase.sin_cos();
        Pose::from_parts(
            Translation3::new(0.005 * sin, 0.004 * cos, 0.27 + 0.01 * cos),
            UnitQuaternion::from_euler_angles(0.05 * sin, 0.15 + 0.15 * cos, 0.05 * cos),
        )
    }

    #[test]
    fn a_moving_platform_is_followed_in_two_or_three_iterations_a_cycle() {
        let mechanism = seed_mechanism();
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
        let mechanism = seed_mechanism();
        let good = mechanism.inverse(&on_the_loop(0)).unwrap().actuators;
        let mut tracker = ForwardTracker::new(mechanism);
        let before = tracker.update(&good).unwrap();
        let broken = Actuators { leg_m: [f64::NAN, 0.27, 0.27], ..good };
        assert_eq!(tracker.update(&broken), Err(ForwardError::NotFinite));
        assert_eq!(tracker.last_theta_rad(), Some(before.theta_rad));
        assert_eq!(tracker.update(&good).unwrap().iterations, 0);
    }

    #[test]
    fn a_jump_or_a_false_last_solution_is_solved_cold() {
        let mechanism = seed_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let mut tracker = ForwardTracker::new(mechanism.clone());
        tracker.last_rad = Some([71.29_f64.to_radians(); LEGS]);
        assert!(tracker.update(&neutral).unwrap().assembly.is_true());
        let far = mechanism.inverse(&on_the_loop(230)).unwrap().actuators;
        assert!(tracker.update(&far).unwrap().assembly.is_true());
        tracker.reset();
        assert_eq!(tracker.last_theta_rad(), None);
    }
}
