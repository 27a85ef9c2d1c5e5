//! The solvers that are compared, and single attempts.

use masseter_controller::kinematics::{
    ForwardTracker, Iteration, MAX_HALVINGS, MAX_ITERATIONS, Method, Options, Residual, StepRule,
    solve_traced,
};
use masseter_shared::geometry::{Actuators, LEGS, Mechanism};

/// A solver with its choices.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Solver {
    /// The paper's algorithm (Fig. 2), with the two choices that its text leaves open.
    Published(Residual, StepRule),
    /// Newton–Raphson with the full increment.
    Newton(Residual),
    /// The controller's certified solver, with the guess as its last solution.
    Controller,
}

/// The paper's algorithm as printed: distances (eq. 1), the increment halved until the error decreases.
pub(super) const PUBLISHED: Solver = Solver::Published(Residual::Distance, StepRule::Halving);
/// Newton–Raphson on the equations as printed.
pub(super) const NEWTON: Solver = Solver::Newton(Residual::Distance);

/// All of them; where only three are compared, they are [`PUBLISHED`], [`NEWTON`] and the controller's.
pub(super) const SOLVERS: [Solver; 9] = [
    PUBLISHED,
    Solver::Published(Residual::Distance, StepRule::CautiousHalving),
    Solver::Published(Residual::Distance, StepRule::QuadraticBacktracking),
    Solver::Published(Residual::SquaredDistance, StepRule::Halving),
    Solver::Published(Residual::SquaredDistance, StepRule::CautiousHalving),
    Solver::Published(Residual::SquaredDistance, StepRule::QuadraticBacktracking),
    NEWTON,
    Solver::Newton(Residual::SquaredDistance),
    Solver::Controller,
];
/// The three that the figures show.
pub(super) const COMPARED: [Solver; 3] = [PUBLISHED, NEWTON, Solver::Controller];

/// The result of one guess.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Attempt {
    /// The leg angles found, radians, or the reason why none were (of `ForwardError::reason`).
    pub found_rad: Result<[f64; LEGS], &'static str>,
    /// Iterations made up to the solution; 0 without one.
    pub iterations: u32,
    /// How often the residuals were evaluated up to the solution; 0 where the solver does not count them.
    pub evaluations: u32,
}

impl Solver {
    /// The full name.
    pub(super) fn name(self) -> String {
        let residual = |residual| match residual {
            Residual::Distance => "distances",
            Residual::SquaredDistance => "squared distances",
        };
        match self {
            Self::Published(form, step) => {
                let step = match step {
                    StepRule::Halving => "halving",
                    StepRule::CautiousHalving => "cautious halving",
                    StepRule::QuadraticBacktracking => "quadratic backtracking",
                };
                format!("published, {}, {step}", residual(form))
            }
            Self::Newton(form) => format!("Newton–Raphson, {}", residual(form)),
            Self::Controller => "controller".to_owned(),
        }
    }

    /// The name in a legend of [`COMPARED`].
    pub(super) fn short_name(self) -> &'static str {
        match self {
            Self::Published(..) => "published",
            Self::Newton(_) => "Newton–Raphson",
            Self::Controller => "controller",
        }
    }

    /// Solves from a guess (radians).
    pub(super) fn attempt(
        self,
        mechanism: &Mechanism,
        actuators: &Actuators,
        guess_rad: &[f64; LEGS],
    ) -> Attempt {
        let Some((method, options)) = self.iteration() else {
            let solved = ForwardTracker::with_guess(mechanism.clone(), *guess_rad).update(actuators);
            let iterations = solved.map_or(0, |solution| solution.iterations);
            let found_rad = solved.map(|solution| solution.theta_rad).map_err(|error| error.reason());
            return Attempt { found_rad, iterations, evaluations: 0 };
        };
        let mut evaluations = 0;
        let observe = |step: &Iteration| evaluations += 1 + step.halvings;
        match solve_traced(method, mechanism, actuators, guess_rad, &options, observe) {
            Ok(solution) => {
                Attempt { found_rad: Ok(solution.theta_rad), iterations: solution.iterations, evaluations }
            }
            Err(error) => Attempt { found_rad: Err(error.reason()), iterations: 0, evaluations: 0 },
        }
    }

    /// The error (eq. 2, cm²) of the guess and after every iteration; nothing for the controller.
    pub(super) fn errors_cm2(
        self,
        mechanism: &Mechanism,
        actuators: &Actuators,
        guess_rad: &[f64; LEGS],
    ) -> Vec<f64> {
        let mut errors_cm2 = Vec::new();
        if let Some((method, options)) = self.iteration() {
            let observe = |step: &Iteration| errors_cm2.push(step.evaluation.error_cm2());
            // The last error shows how it ended.
            let _ = solve_traced(method, mechanism, actuators, guess_rad, &options, observe);
        }
        errors_cm2
    }

    /// With the greatest possible numbers of iterations and reductions, so that it does not fail by a bound.
    pub(super) fn iteration(self) -> Option<(Method, Options)> {
        let most =
            Options { max_iterations: MAX_ITERATIONS, max_halvings: MAX_HALVINGS, ..Options::default() };
        match self {
            Self::Published(residual, step) => Some((Method::Published, Options { residual, step, ..most })),
            Self::Newton(residual) => Some((Method::Newton, Options { residual, ..most })),
            Self::Controller => None,
        }
    }
}
