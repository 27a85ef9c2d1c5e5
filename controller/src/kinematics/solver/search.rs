//! One step of either iteration after the other. Nothing here decides when to end.

use masseter_model::geometry::LEGS;
use nalgebra::{Matrix3, Vector3};

use super::{MAX_HALVINGS, Method, Options, Residual, StepRule};
use crate::kinematics::{Equations, Evaluation, ForwardError};

/// Below this the Newton direction is noise; unitless, see [`Equations::determinant`].
const SMALLEST_DETERMINANT: f64 = 1e-10;
/// The share of the decrease which the slope promises that counts as sufficient (Numerical Recipes).
const SUFFICIENT_SHARE: f64 = 1e-4;

/// What stays the same over the iterations.
pub(super) struct Search<'a> {
    pub equations: Equations<'a>,
    pub method: Method,
    pub options: &'a Options,
}

/// One iteration as it went: the guess is number 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Iteration {
    /// From 0.
    pub number: u32,
    /// The leg angles it arrived at, not wrapped, and the equations there.
    pub evaluation: Evaluation,
    /// The increment that was made, radians.
    pub increment_rad: Vector3<f64>,
    /// How often the increment was reduced before.
    pub halvings: u32,
    /// The share of the Newton increment that was made.
    share: f64,
}

impl Iteration {
    pub(super) fn guess(equations: &Equations<'_>, guess_rad: &[f64; LEGS]) -> Self {
        let evaluation = equations.evaluate(Vector3::from(*guess_rad));
        Self { number: 0, evaluation, increment_rad: Vector3::zeros(), halvings: 0, share: 1.0 }
    }

    /// Also where the error is no number.
    pub(super) fn is_above(&self, epsilon_cm2: f64) -> bool {
        self.evaluation.error_cm2().partial_cmp(&epsilon_cm2).is_none_or(std::cmp::Ordering::is_gt)
    }
}

impl Search<'_> {
    /// What must vanish, in the form asked for; the sum of its squares must decrease.
    fn residual(&self, at: &Evaluation) -> Vector3<f64> {
        match self.options.residual {
            Residual::Distance => at.residual_m,
            Residual::SquaredDistance => self.equations.squared_residual_m2(at),
        }
    }

    fn error(&self, at: &Evaluation) -> f64 {
        self.residual(at).norm_squared()
    }

    /// −J⁻¹ f, radians.
    pub(super) fn newton_increment(&self, at: &Evaluation) -> Result<Vector3<f64>, ForwardError> {
        let determinant = self.equations.determinant(at);
        let singular = ForwardError::Singular { determinant, residual_m: at.residual_norm_m() };
        if determinant.is_nan() || determinant.abs() < SMALLEST_DETERMINANT {
            return Err(singular);
        }
        let of_distances = self.equations.jacobian(at);
        let jacobian = match self.options.residual {
            Residual::Distance => of_distances,
            Residual::SquaredDistance => {
                Matrix3::from_diagonal(&(self.equations.distances_m(at) * 2.0)) * of_distances
            }
        };
        let inverse = jacobian.try_inverse().ok_or(singular)?;
        Ok(-(inverse * self.residual(at)))
    }

    /// The inner loop of Fig. 2; none when no allowed reduction decreases the error.
    pub(super) fn advanced(&self, from: &Iteration, newton: Vector3<f64>) -> Option<Iteration> {
        let evaluate = |share: f64, halvings| {
            let increment_rad = newton * share;
            let evaluation = self.equations.evaluate(from.evaluation.theta_rad + increment_rad);
            Iteration { number: from.number + 1, evaluation, increment_rad, halvings, share }
        };
        if self.method == Method::Newton {
            return Some(evaluate(1.0, 0));
        }
        let before = self.error(&from.evaluation);
        let mut share = match self.options.step {
            StepRule::CautiousHalving => (2.0 * from.share).min(1.0),
            StepRule::Halving | StepRule::QuadraticBacktracking => 1.0,
        };
        for halvings in 0..=self.options.max_halvings.min(MAX_HALVINGS) {
            let iteration = evaluate(share, halvings);
            let after = self.error(&iteration.evaluation);
            if after < self.enough(before, share) {
                return Some(iteration);
            }
            share = self.reduced(share, before, after);
        }
        None
    }

    /// What the error must fall below. Along Newton's direction its slope is −2 errors per increment.
    fn enough(&self, before: f64, share: f64) -> f64 {
        match self.options.step {
            StepRule::QuadraticBacktracking => before * (1.0 - 2.0 * SUFFICIENT_SHARE * share),
            StepRule::Halving | StepRule::CautiousHalving => before,
        }
    }

    fn reduced(&self, share: f64, before: f64, after: f64) -> f64 {
        match self.options.step {
            StepRule::Halving | StepRule::CautiousHalving => share / 2.0,
            StepRule::QuadraticBacktracking => {
                let lowest = before * share * share / (after - before + 2.0 * before * share);
                // Without a number for the error there is no parabola: `max` then takes the tenth.
                lowest.max(share / 10.0).min(share / 2.0)
            }
        }
    }
}
