//! A general solver without knowledge of the mechanism's structure: MINPACK's Levenberg–Marquardt, from the crate of
//! that name. It solves the paper's equations with their derivatives, to full precision.

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use masseter_controller::kinematics::Equations;
use masseter_model::geometry::{Actuators, LEGS, Mechanism};
use nalgebra_0_34::{Matrix3, U3, Vector3};

/// Largest error of a side that counts as closed, metres. Newton's iteration ends at the same error.
const CLOSED_WITHIN_M: f64 = 1e-14;

/// The leg angles of the solution from a guess, radians; none if they close no platform.
pub(super) fn solve(
    mechanism: &Mechanism,
    actuators: &Actuators,
    guess_rad: [f64; LEGS],
) -> Option<[f64; LEGS]> {
    let problem = Problem { equations: Equations::new(mechanism, actuators), theta_rad: guess_rad.into() };
    let (problem, report) = LevenbergMarquardt::new().minimize(problem);
    // The solver minimises half the sum of squares.
    (2.0 * report.objective_function < CLOSED_WITHIN_M * CLOSED_WITHIN_M).then(|| problem.theta_rad.into())
}

struct Problem<'a> {
    equations: Equations<'a>,
    theta_rad: Vector3<f64>,
}

impl Problem<'_> {
    fn evaluation(&self) -> masseter_controller::kinematics::Evaluation {
        self.equations.evaluate(<[f64; LEGS]>::from(self.theta_rad).into())
    }
}

impl LeastSquaresProblem<f64, U3, U3> for Problem<'_> {
    type ResidualStorage = nalgebra_0_34::storage::Owned<f64, U3>;
    type JacobianStorage = nalgebra_0_34::storage::Owned<f64, U3, U3>;
    type ParameterStorage = nalgebra_0_34::storage::Owned<f64, U3>;

    fn set_params(&mut self, theta_rad: &Vector3<f64>) {
        self.theta_rad = *theta_rad;
    }

    fn params(&self) -> Vector3<f64> {
        self.theta_rad
    }

    fn residuals(&self) -> Option<Vector3<f64>> {
        Some(<[f64; LEGS]>::from(self.evaluation().residual_m).into())
    }

    fn jacobian(&self) -> Option<Matrix3<f64>> {
        Some(<[[f64; LEGS]; LEGS]>::from(self.equations.jacobian(&self.evaluation())).into())
    }
}
