//! What a solver hands back: leg angles that close the platform's triangle, and what is known of them.

use masseter_shared::geometry::{LEGS, Pose};

use super::closure::{Closed, Closure};
use super::heading::Heading;
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
    pub(super) headings: [Heading; LEGS],
}

impl Solution {
    pub(super) fn new(closure: &Closure<'_>, closed: &Closed) -> Self {
        Self::with_angles(closure, closed, closed.headings.map(Heading::to_rad))
    }

    /// The same with the headings' angles from elsewhere, radians.
    #[inline]
    pub(super) fn with_angles(closure: &Closure<'_>, closed: &Closed, theta_rad: [f64; LEGS]) -> Self {
        let corners = closure.corners(&closed.headings);
        let determinant = closure.determinant(&closed.closing);
        Self {
            theta_rad,
            pose: closure.mechanism.pose_from_corners(&corners),
            iterations: closed.iterations,
            residual_m: closure.residual_m(&closed.closing),
            determinant,
            assembly: Assembly::of(closure.mechanism, &closure.hinges, &corners, determinant),
            certificate: Certificate::new(closure, &closed.closing),
            headings: closed.headings,
        }
    }
}
