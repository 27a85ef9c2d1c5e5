//! What a solver hands back: leg angles that close the platform's triangle, and what is known of them.

use masseter_model::geometry::{LEGS, Pose, frame_of_corners};

use super::leg_angle::LegAngle;
use super::loop_equations::{LoopEquations, LoopSolution};
use super::{Assembly, Certificate};

/// Leg angles that close the platform's triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// θ₁ θ₂ θ₃ in (−π, π], radians.
    pub theta_rad: [f64; LEGS],
    /// The platform in the base frame, metres.
    pub pose: Pose,
    /// Iterations made from the start that led here.
    pub iterations: u32,
    /// The largest |fₖ|, metres.
    pub residual_m: f64,
    /// Determinant of the Jacobian with every leg's length taken as 1; 0 where solutions meet.
    pub determinant: f64,
    /// Which conditions of the true solution hold.
    pub assembly: Assembly,
    /// What is proven; none too close to a singularity, or where the iteration stopped too early.
    pub certificate: Option<Certificate>,
    pub(super) leg_angles: [LegAngle; LEGS],
}

impl Solution {
    pub(super) fn new(loops: &LoopEquations<'_>, closed: &LoopSolution) -> Self {
        Self::with_angles(loops, closed, closed.leg_angles.map(LegAngle::to_rad))
    }

    /// The same solution with these angles, radians.
    #[inline]
    pub(super) fn with_angles(
        loops: &LoopEquations<'_>,
        closed: &LoopSolution,
        theta_rad: [f64; LEGS],
    ) -> Self {
        let corners = loops.corners(&closed.leg_angles);
        let determinant = loops.determinant(&closed.residuals);
        Self {
            theta_rad,
            pose: frame_of_corners(&corners),
            iterations: closed.iterations,
            residual_m: loops.residual_m(&closed.residuals),
            determinant,
            assembly: Assembly::from_corners(loops.mechanism, &loops.hinges, &corners, determinant),
            certificate: Certificate::new(loops, &closed.residuals),
            leg_angles: closed.leg_angles,
        }
    }
}
