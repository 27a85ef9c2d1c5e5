//! The three equations of the forward kinematics (the paper, eq. 1) and their derivatives.
//!
//! fₖ = |Aᵢ − Aⱼ| − Lᵢⱼ for the sides 12, 23, 31 of the platform, each a function of the two leg angles
//! at its ends. Nothing here searches for a solution.

use masseter_model::geometry::{Actuators, LEGS, Mechanism, Vec3};
use nalgebra::{Matrix3, Vector3};

use super::legs::next;

/// The equations for one input. Only the leg angles vary.
#[derive(Debug, Clone, Copy)]
pub struct Equations<'a> {
    mechanism: &'a Mechanism,
    actuators: Actuators,
}

/// The equations' values at one set of leg angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evaluation {
    /// θ₁ θ₂ θ₃, radians.
    pub theta_rad: Vector3<f64>,
    /// Corners A₁, A₂, A₃ in the base frame, metres.
    pub corners: [Vec3; LEGS],
    /// f₁ f₂ f₃: excess lengths of the sides 12, 23, 31, metres.
    pub residual_m: Vector3<f64>,
}

impl<'a> Equations<'a> {
    /// The equations for an input in metres.
    pub fn new(mechanism: &'a Mechanism, actuators: &Actuators) -> Self {
        Self { mechanism, actuators: *actuators }
    }

    /// Corners and residuals at leg angles in radians.
    pub fn evaluate(&self, theta_rad: Vector3<f64>) -> Evaluation {
        let corners = self.mechanism.corners_from_angles(&self.actuators, &theta_rad.into());
        let sides_m = self.mechanism.platform_sides_m();
        let residual_m =
            Vector3::from_fn(|side, _| (corners[side] - corners[next(side)]).norm() - sides_m[side]);
        Evaluation { theta_rad, corners, residual_m }
    }

    /// ∂fₖ/∂θᵢ in m/rad: row k for the side, column i for the leg. Not finite where two corners meet.
    pub fn jacobian(&self, at: &Evaluation) -> Matrix3<f64> {
        let mut jacobian = self.directions(at);
        for (mut column, leg_m) in jacobian.column_iter_mut().zip(self.actuators.leg_m) {
            column *= leg_m;
        }
        jacobian
    }

    /// |A₁A₂|, |A₂A₃|, |A₃A₁|, metres.
    pub(super) fn distances_m(&self, at: &Evaluation) -> Vector3<f64> {
        at.residual_m + Vector3::from(self.mechanism.platform_sides_m())
    }

    /// |AᵢAⱼ|² − Lᵢⱼ² for the three sides, m²: (|AᵢAⱼ| − Lᵢⱼ)(|AᵢAⱼ| + Lᵢⱼ), so that nothing cancels twice.
    pub(super) fn squared_residual_m2(&self, at: &Evaluation) -> Vector3<f64> {
        at.residual_m.component_mul(&(at.residual_m + Vector3::from(self.mechanism.platform_sides_m()) * 2.0))
    }

    /// Determinant of the Jacobian with every leg's length taken as 1: unitless and at most 2. The determinant is
    /// positive in the assembly of the neutral pose, and 0 where solutions meet.
    pub fn determinant(&self, at: &Evaluation) -> f64 {
        self.directions(at).determinant()
    }

    fn directions(&self, at: &Evaluation) -> Matrix3<f64> {
        let sin_cos = std::array::from_fn(|leg| at.theta_rad[leg].sin_cos());
        directions(self.mechanism, &at.corners, &sin_cos)
    }
}

/// Row k holds the cosines between side k and the directions in which its two ends swing.
pub(super) fn directions(
    mechanism: &Mechanism,
    corners: &[Vec3; LEGS],
    sin_cos: &[(f64, f64); LEGS],
) -> Matrix3<f64> {
    let swings: [Vec3; LEGS] = std::array::from_fn(|leg| {
        let (sin, cos) = sin_cos[leg];
        Vec3::z() * cos - mechanism.inward_direction(leg) * sin
    });
    let mut rows = Matrix3::zeros();
    for side in 0..LEGS {
        let far = next(side);
        let along_side = (corners[side] - corners[far]).normalize();
        rows[(side, side)] = along_side.dot(&swings[side]);
        rows[(side, far)] = -along_side.dot(&swings[far]);
    }
    rows
}

impl Evaluation {
    /// f₁² + f₂² + f₃² (the paper, eq. 2), cm².
    pub fn error_cm2(&self) -> f64 {
        self.residual_m.norm_squared() * 1e4
    }

    /// The largest |fₖ|, metres; NaN as soon as one is NaN.
    pub fn residual_norm_m(&self) -> f64 {
        self.residual_m.iter().fold(0.0, |worst: f64, f| if f.abs() <= worst { worst } else { f.abs() })
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::tests::{mechanisms, poses, published_mechanism};

    #[test]
    fn neutral_input_of_the_paper_has_the_known_solution_and_a_positive_determinant() {
        let mechanism = published_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let equations = Equations::new(&mechanism, &neutral);
        let solution = equations.evaluate(Vector3::repeat(83.862_391_93_f64.to_radians()));
        assert!(solution.residual_norm_m() < 1e-9);
        assert!(equations.determinant(&solution) > 0.5);
    }

    proptest! {
        #[test]
        fn jacobian_is_the_derivative_of_the_residuals(mechanism in mechanisms(), pose in poses(25.0)) {
            let joints = mechanism.inverse(&pose).unwrap();
            let equations = Equations::new(&mechanism, &joints.actuators);
            let theta = Vector3::from(joints.theta_rad).add_scalar(0.05);
            let jacobian = equations.jacobian(&equations.evaluate(theta));
            let h = 1e-6;
            for leg in 0..LEGS {
                let step = Vector3::ith(leg, h);
                let forward = equations.evaluate(theta + step).residual_m;
                let backward = equations.evaluate(theta - step).residual_m;
                let difference = (forward - backward) / (2.0 * h);
                prop_assert!((difference - jacobian.column(leg)).norm() < 1e-8);
            }
        }

        #[test]
        fn inverse_kinematics_solves_the_equations(mechanism in mechanisms(), pose in poses(25.0)) {
            let joints = mechanism.inverse(&pose).unwrap();
            let equations = Equations::new(&mechanism, &joints.actuators);
            prop_assert!(equations.evaluate(joints.theta_rad.into()).residual_norm_m() < 1e-14);
        }
    }
}
