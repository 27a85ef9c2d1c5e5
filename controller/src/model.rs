//! What the controller believes of the mechanism: inverse dynamics with friction.
//!
//! τ = J⁻ᵀ (M V̇ + h − w) + friction, with the [equations](masseter_shared::dynamics) of the rigid bodies.

use masseter_shared::config::Scenario;
use masseter_shared::dynamics::{Bodies, Equations, Motion};
use masseter_shared::geometry::{Mechanism, Pose, Twist};
use nalgebra::Vector6;

use crate::friction::Friction;

/// Masses and friction of a mechanism.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    mechanism: Mechanism,
    pub(crate) bodies: Bodies,
    pub(crate) friction: Friction,
}

impl Model {
    /// The model in which the controller of a scenario believes.
    pub(crate) fn new(scenario: &Scenario, mechanism: Mechanism) -> Self {
        let config = scenario.model();
        Self { mechanism, bodies: Bodies::from(&config), friction: Friction::new(&config) }
    }

    /// The motion of a pose and a twist (m/s, rad/s); none for a pose without joint coordinates.
    pub(crate) fn motion(&self, pose: &Pose, twist: &Twist) -> Option<Motion> {
        Motion::new(&self.mechanism, pose, twist).ok()
    }

    /// Forces of the axes d₁ d₂ d₃ l₁ l₂ l₃ (N) that give a motion the acceleration V̇ (m/s², rad/s²), without an external
    /// wrench; none in a singular pose.
    pub(crate) fn force_n(&self, motion: &Motion, acceleration: &Twist) -> Option<Vector6<f64>> {
        let moved = Equations::new(&self.bodies, motion).inverse(acceleration, &Twist::zeros())?;
        Some(moved + self.friction.force_n(&motion.rates_m_s))
    }
}

/// The constant twist that leads from one pose to another in a time (s), base axes, m/s and rad/s.
pub(crate) fn twist_between(from: &Pose, to: &Pose, time_s: f64) -> Twist {
    let way = to.translation.vector - from.translation.vector;
    let turn = (to.rotation * from.rotation.inverse()).scaled_axis();
    Twist::new(way.x, way.y, way.z, turn.x, turn.y, turn.z) / time_s
}
