//! How fast the axes may move: `[limits]`.

use serde::{Deserialize, Serialize};

use super::ScenarioError;
use super::need::require_positive;

/// What the axes may be asked for by a trajectory. Strokes are the mechanism's own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrajectoryLimitsConfig {
    /// Speed of a slide, m/s.
    pub slide_velocity_m_s: f64,
    /// Speed of a leg, m/s.
    pub leg_velocity_m_s: f64,
    /// Acceleration of a slide, m/s².
    pub slide_acceleration_m_s2: f64,
    /// Acceleration of a leg, m/s².
    pub leg_acceleration_m_s2: f64,
    /// Condition number of the 6×6 Jacobian, angular velocities scaled by the platform's side A₁A₂.
    pub max_condition: f64,
}

impl Default for TrajectoryLimitsConfig {
    /// Velocities stay a quarter below the drives' own limits. Fast human chewing (0.46 s a cycle)
    /// takes 3.5 m/s² of a leg, and a jaw tracker's own jumps, low-passed at 12 Hz, up to 5.8 m/s² of
    /// a slide: 8 m/s² lets both pass and stops what is no jaw motion.
    fn default() -> Self {
        Self {
            slide_velocity_m_s: 0.15,
            leg_velocity_m_s: 0.30,
            slide_acceleration_m_s2: 8.0,
            leg_acceleration_m_s2: 8.0,
            max_condition: 10.0,
        }
    }
}

impl TrajectoryLimitsConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_positive(&[
            ("limits.slide_velocity_m_s", self.slide_velocity_m_s),
            ("limits.leg_velocity_m_s", self.leg_velocity_m_s),
            ("limits.slide_acceleration_m_s2", self.slide_acceleration_m_s2),
            ("limits.leg_acceleration_m_s2", self.leg_acceleration_m_s2),
            ("limits.max_condition", self.max_condition),
        ])
    }
}
