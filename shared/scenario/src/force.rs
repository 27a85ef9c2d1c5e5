//! Estimate and control of the bite force: `[force_estimate]` and `[force_control]`.

use std::f64::consts::FRAC_2_PI;

use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::need::{require_positive, require_within};

section! {
    /// The estimate of the external force on the platform from the forces of the drives.
    #[derive(Copy)]
    pub struct ForceEstimateConfig {
        /// Time constant of the observer, s.
        pub observer_time_s: f64 = 0.003,
        /// By which share the friction of a moving axis may differ from the model's.
        pub friction_uncertainty: f64 = 0.1,
        /// Speed of an axis below which its friction is not known but for its largest size, m/s.
        pub rest_speed_m_s: f64 = 0.002,
    }
}

/// The course of the desired bite force from the contact on.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BiteProfile {
    /// Half a sine from the force of contact to the peak and back.
    #[default]
    HalfSine,
    /// A ramp of a tenth of the bite to the peak, which is held.
    Hold,
}

/// Which force is controlled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ForceSource {
    /// The estimate from the forces of the drives.
    #[default]
    Estimate,
    /// The measurement of the load cell.
    LoadCell,
}

section! {
    /// Control of the bite force, between contact and opening of the mouth.
    #[derive(Copy)]
    pub struct ForceControlConfig {
        /// Where the bite force is known from.
        pub source: ForceSource = ForceSource::Estimate,
        /// The course of the desired force.
        pub profile: BiteProfile = BiteProfile::HalfSine,
        /// Bite force at which force control takes over from position control, N.
        pub contact_n: f64 = 10.0,
        /// Largest desired bite force, N.
        pub peak_n: f64 = 30.0,
        /// Duration of a bite, s.
        pub bite_s: f64 = 0.3,
        /// Admittance: force per closing speed while there is food between the teeth, N per m/s.
        pub damping_n_s_per_m: f64 = 100.0,
        /// The stiffest food that this damping is for, N/m.
        pub food_stiffness_n_per_m: f64 = 3500.0,
        /// Admittance where the teeth meet, N per m/s.
        pub tooth_damping_n_s_per_m: f64 = 2000.0,
        /// Stiffness of teeth, their holder and the drives in series, N/m.
        pub tooth_stiffness_n_per_m: f64 = 3.6e5,
        /// Opening of the mouth below which the damping grows towards that of the teeth, m.
        pub tooth_zone_m: f64 = 5e-4,
        /// Largest speed of closing on food, and of giving way after a bite, m/s.
        pub closing_m_s: f64 = 0.06,
        /// Largest distance of the platform from the motion, m.
        pub reach_m: f64 = 0.012,
    }
}

impl ForceEstimateConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_within(&[
            ("force_estimate.observer_time_s", self.observer_time_s, 0.0, 1.0),
            ("force_estimate.friction_uncertainty", self.friction_uncertainty, 0.0, 10.0),
            ("force_estimate.rest_speed_m_s", self.rest_speed_m_s, 0.0, 0.1),
        ])
    }
}

impl ForceControlConfig {
    /// Time constant of the admittance, virtual mass by damping, s.
    pub const MASS_TIME_S: f64 = 0.003;

    /// The least damping with which the loop is stable against a stiffness (N/m) with a delay (s), N per m/s: 2/π k t. It is
    /// the limit of a pure delay; the lags of the rig turn the phase less.
    pub fn least_damping_n_s_per_m(stiffness_n_per_m: f64, delay_s: f64) -> f64 {
        FRAC_2_PI * stiffness_n_per_m * delay_s
    }

    /// Refuses values without use, and a damping below the limit of stability for the delays of lead and of the
    /// observer or the load cell (s).
    pub(super) fn validate(&self, lead_s: f64, source_s: f64) -> Result<(), ScenarioError> {
        require_positive(&[
            ("force_control.contact_n", self.contact_n),
            ("force_control.bite_s", self.bite_s),
            ("force_control.tooth_zone_m", self.tooth_zone_m),
            ("force_control.closing_m_s", self.closing_m_s),
            ("force_control.food_stiffness_n_per_m", self.food_stiffness_n_per_m),
            ("force_control.tooth_stiffness_n_per_m", self.tooth_stiffness_n_per_m),
        ])?;
        require_within(&[
            ("force_control.peak_n", self.peak_n, self.contact_n, 1000.0),
            ("force_control.reach_m", self.reach_m, 1e-6, 0.05),
        ])?;
        let delay_s = lead_s + source_s + Self::MASS_TIME_S;
        for (key, damping, stiffness) in [
            ("force_control.damping_n_s_per_m", self.damping_n_s_per_m, self.food_stiffness_n_per_m),
            (
                "force_control.tooth_damping_n_s_per_m",
                self.tooth_damping_n_s_per_m,
                self.tooth_stiffness_n_per_m,
            ),
        ] {
            let least = Self::least_damping_n_s_per_m(stiffness, delay_s);
            if !(damping >= least && damping.is_finite()) {
                let need = format!(
                    "use at least {least:.1}: with less, the loop is not stable against {stiffness} N/m with a delay of \
                     {:.1} ms; or state a smaller stiffness",
                    delay_s * 1e3
                );
                return Err(ScenarioError::bad(key, &damping, need));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_damping_below_the_limit_of_stability_is_refused_with_the_limit() {
        let control = ForceControlConfig::default();
        let soft = |damping_n_s_per_m| ForceControlConfig { damping_n_s_per_m, ..control };
        // 2/π · 3500 N/m · 8 ms = 17.8 N s/m.
        for (control, reason) in [
            (control, None),
            (soft(18.0), None),
            (soft(17.0), Some("force_control.damping_n_s_per_m = 17: use at least 17.8")),
            (soft(f64::NAN), Some("damping_n_s_per_m = NaN")),
            (
                ForceControlConfig { tooth_stiffness_n_per_m: 5e6, ..control },
                Some("force_control.tooth_damping_n_s_per_m = 2000: use at least 25464.8"),
            ),
            (ForceControlConfig { peak_n: 5.0, ..control }, Some("force_control.peak_n = 5: use 10 to 1000")),
        ] {
            let said = control.validate(0.002, 0.003).map_err(|error| error.to_string());
            match reason {
                None => assert_eq!(said, Ok(())),
                Some(reason) => assert!(said.as_ref().is_err_and(|said| said.contains(reason)), "{said:?}"),
            }
        }
    }
}
