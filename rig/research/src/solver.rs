//! The solvers that are compared, and single attempts.

use std::f64::consts::{PI, TAU};

use masseter_controller::kinematics::Residual::{Distance, SquaredDistance};
use masseter_controller::kinematics::StepRule::{BoundedStep, FullStep, TimeStep};
use masseter_controller::kinematics::{
    ForwardTracker, Iteration, MAX_HALVINGS, MAX_ITERATIONS, Method, Options, Residual, StepRule,
    solve_traced,
};
use masseter_model::geometry::{Actuators, LEGS, Mechanism};

/// A solver with its choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Solver {
    pub name: &'static str,
    /// None for the controller's certified solver, which takes the guess as its last solution.
    iteration: Option<(Method, Residual, StepRule)>,
}

/// A reading of the paper's algorithm (Fig. 2), with the two choices that its text leaves open.
const fn reading(name: &'static str, residual: Residual, step: StepRule) -> Solver {
    Solver { name, iteration: Some((Method::Published, residual, step)) }
}

/// Newton–Raphson with the full increment.
const fn newton(name: &'static str, residual: Residual) -> Solver {
    Solver { name, iteration: Some((Method::Newton, residual, FullStep)) }
}

/// The paper's algorithm as printed: distances (eq. 1), the increment halved until the error decreases.
pub(crate) const PUBLISHED: Solver = reading("reduced full steps, distances", Distance, FullStep);
/// Newton–Raphson on the equations as printed.
pub(crate) const NEWTON: Solver = newton("Newton–Raphson, distances", Distance);
const NEWTON_SQUARED: Solver = newton("Newton–Raphson, squared distances", SquaredDistance);
/// The controller's certified solver.
pub(crate) const CONTROLLER: Solver = Solver { name: "controller", iteration: None };

/// All of them: the readings, Newton–Raphson with each residual, and the controller's.
pub(crate) const SOLVERS: [Solver; 9] = [
    PUBLISHED,
    reading("bounded increments, distances", Distance, BoundedStep),
    reading("time steps, distances", Distance, TimeStep),
    reading("reduced full steps, squared distances", SquaredDistance, FullStep),
    reading("bounded increments, squared distances", SquaredDistance, BoundedStep),
    reading("time steps, squared distances", SquaredDistance, TimeStep),
    NEWTON,
    NEWTON_SQUARED,
    CONTROLLER,
];
/// The three whose times are compared, in this order.
pub(crate) const TIMED: [Solver; 3] = [PUBLISHED, NEWTON, CONTROLLER];

/// What a solver starts with.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Start {
    pub actuators: Actuators,
    /// Leg angles.
    pub guess_rad: [f64; LEGS],
}

/// What a solver found from one guess.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Found {
    pub theta_rad: [f64; LEGS],
    pub iterations: u32,
    /// How often the residuals were evaluated; 0 where the solver does not count them.
    pub evaluations: u32,
}

impl Solver {
    /// Newton–Raphson with the same residual.
    pub(crate) fn rival(self) -> Self {
        match self.iteration {
            Some((_, SquaredDistance, _)) => NEWTON_SQUARED,
            _ => NEWTON,
        }
    }

    /// Solves. The error is that of `ForwardError::reason`.
    pub(crate) fn attempt(self, mechanism: &Mechanism, start: &Start) -> Result<Found, &'static str> {
        let Start { actuators, guess_rad } = start;
        let mut evaluations = 0;
        let observe = |step: &Iteration| evaluations += 1 + step.halvings;
        let solved = match self.iteration() {
            Some((method, options)) => {
                solve_traced(method, mechanism, actuators, guess_rad, &options, observe)
            }
            None => ForwardTracker::with_guess(mechanism.clone(), *guess_rad).update(actuators),
        };
        let solution = solved.map_err(|error| error.reason())?;
        Ok(Found { theta_rad: solution.theta_rad, iterations: solution.iterations, evaluations })
    }

    /// The error (eq. 2, cm²) of the guess and after every iteration; nothing for the controller.
    pub(crate) fn errors_cm2(self, mechanism: &Mechanism, start: &Start) -> Vec<f64> {
        let mut errors_cm2 = Vec::new();
        if let Some((method, options)) = self.iteration() {
            let observe = |step: &Iteration| errors_cm2.push(step.evaluation.error_cm2());
            // The last error shows how it ended.
            let _ = solve_traced(method, mechanism, &start.actuators, &start.guess_rad, &options, observe);
        }
        errors_cm2
    }

    /// With the greatest possible numbers of iterations and reductions, so that it does not fail by a bound.
    pub(crate) fn iteration(self) -> Option<(Method, Options)> {
        let (method, residual, step) = self.iteration?;
        let bounds =
            Options { max_iterations: MAX_ITERATIONS, max_halvings: MAX_HALVINGS, ..Options::default() };
        Some((method, Options { residual, step, ..bounds }))
    }
}

/// The largest difference of any leg's angle, around the circle, radians.
pub(crate) fn distance_rad(a: &[f64; LEGS], b: &[f64; LEGS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| ((a - b + PI).rem_euclid(TAU) - PI).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_go_the_short_way_round() {
        let distance = distance_rad(&[3.1, 0.0, 1.0], &[-3.1, 0.01, 1.0]);
        assert!((distance - (TAU - 6.2)).abs() < 1e-12);
    }
}
