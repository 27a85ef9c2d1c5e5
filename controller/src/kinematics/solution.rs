//! What a solver hands back: leg angles that close the platform's triangle, and what is known of them.

use masseter_shared::geometry::{Actuators, LEGS, Mechanism, Pose};

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
    pub(super) fn new(
        mechanism: &Mechanism,
        actuators: &Actuators,
        closure: &Closure,
        closed: &Closed,
    ) -> Self {
        let theta_rad = closed.headings.map(Heading::to_rad);
        let corners = std::array::from_fn(|leg| {
            let Heading { cos, sin } = closed.headings[leg];
            let mut corner = mechanism.hinge(leg, actuators.slide_m[leg])
                + mechanism.inward_direction(leg) * (cos * actuators.leg_m[leg]);
            corner.z += sin * actuators.leg_m[leg];
            corner
        });
        let determinant = closure.determinant(&closed.closing);
        Self {
            theta_rad,
            pose: mechanism.pose_from_corners(&corners),
            iterations: closed.iterations,
            residual_m: closure.residual_m(&closed.closing),
            determinant,
            assembly: Assembly::of(mechanism, actuators, &corners, determinant),
            certificate: Certificate::new(closure, &closed.closing),
            headings: closed.headings,
        }
    }
}
