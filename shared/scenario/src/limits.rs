//! Limits of trajectories: `[limits]`.

use masseter_model::geometry::LEGS;

use super::DrivesConfig;
use super::error::ScenarioError;
use super::need::{keyed, require_positive};

section! {
    /// What the axes may be asked for by a trajectory, where their drives do not allow less. Strokes are the mechanism's
    /// own.
    ///
    /// Velocities stay a quarter below the drives' own limits. Fast human chewing (0.46 s a cycle) takes 3.5 m/s² of a
    /// leg. A jaw tracker's own jumps, low-passed at 12 Hz, take up to 5.8 m/s² of a slide. The limit of 8 m/s² admits
    /// both, and refuses what is no jaw motion.
    #[derive(Copy)]
    pub struct TrajectoryLimitsConfig {
        /// Speed of a slide, m/s.
        pub slide_velocity_m_s: f64 = 0.15,
        /// Speed of a leg, m/s.
        pub leg_velocity_m_s: f64 = 0.30,
        /// Acceleration of a slide, m/s².
        pub slide_acceleration_m_s2: f64 = 8.0,
        /// Acceleration of a leg, m/s².
        pub leg_acceleration_m_s2: f64 = 8.0,
        /// Condition number of the 6×6 Jacobian, angular velocities scaled by the platform's side A₁A₂.
        pub max_condition: f64 = 10.0,
    }
}

impl TrajectoryLimitsConfig {
    /// Speed of an axis, m/s.
    pub const fn velocity_m_s(&self, axis: usize) -> f64 {
        if axis < LEGS { self.slide_velocity_m_s } else { self.leg_velocity_m_s }
    }

    /// Acceleration of an axis, m/s².
    pub const fn acceleration_m_s2(&self, axis: usize) -> f64 {
        if axis < LEGS { self.slide_acceleration_m_s2 } else { self.leg_acceleration_m_s2 }
    }

    /// The lower of these limits and the limits of the drives.
    #[must_use]
    pub fn within(self, drives: &DrivesConfig) -> Self {
        Self {
            slide_velocity_m_s: self.slide_velocity_m_s.min(drives.slide.max_velocity_m_s),
            leg_velocity_m_s: self.leg_velocity_m_s.min(drives.leg.max_velocity_m_s),
            slide_acceleration_m_s2: self.slide_acceleration_m_s2.min(drives.slide.max_acceleration_m_s2),
            leg_acceleration_m_s2: self.leg_acceleration_m_s2.min(drives.leg.max_acceleration_m_s2),
            ..self
        }
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_positive(&keyed!("limits", self,
            slide_velocity_m_s leg_velocity_m_s slide_acceleration_m_s2 leg_acceleration_m_s2 max_condition
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_faster_than_a_drive_are_refused() {
        let (limits, mut drives) = (TrajectoryLimitsConfig::default(), DrivesConfig::default());
        assert_eq!(limits.within(&drives), limits);
        drives.leg.max_velocity_m_s = 0.1;
        assert_eq!(limits.within(&drives), TrajectoryLimitsConfig { leg_velocity_m_s: 0.1, ..limits });
        drives.slide.max_velocity_m_s = 0.05;
        assert_eq!(limits.within(&drives).slide_velocity_m_s.to_bits(), 0.05_f64.to_bits());
    }
}
