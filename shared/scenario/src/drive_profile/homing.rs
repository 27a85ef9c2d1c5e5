//! Homing of a kind of drive (CiA 402, mode 6).

use masseter_can::canopen::ObjectAddress;

use super::object::ObjectKey;
use crate::error::ScenarioError;
use crate::need::require_positive;

section! {
    /// How a drive finds its zero, and what 6064h must show there.
    #[derive(Copy)]
    pub struct HomingConfig {
        /// Homing method (6098h).
        pub method: i8 = 37,
        /// Whether the encoder keeps its position without power: then the drive is compared and not moved.
        pub absolute: bool = true,
        /// d or l at the home position, m; absent where the drive's own zero is right.
        pub home_position_m: Option<f64> = None,
        /// The object that sets 6064h at home.
        pub home_object: ObjectKey = ObjectKey(ObjectAddress::new(0x607C, 0)),
        /// Its sign: −1 for the standard's, where 6064h becomes minus the offset.
        pub home_sign: i8 = -1,
        /// Whether the software limits (607Dh) count from home; otherwise from the zero of 6064h.
        pub limits_from_home: bool = true,
        /// Speed of the search for the switch (6099h:01), m/s.
        pub speed_m_s: f64 = 0.02,
        /// Speed of the search for the zero (6099h:02), m/s.
        pub zero_speed_m_s: f64 = 0.004,
        /// Acceleration (609Ah), m/s².
        pub acceleration_m_s2: f64 = 0.5,
        /// How far a second homing may be from the first, m.
        pub tolerance_m: f64 = 5e-5,
    }
}

impl HomingConfig {
    /// What `home_object` must be, in increments of a scale with that many metres an increment.
    pub fn home_increments(&self, increment_m: f64) -> i32 {
        let home_m = self.home_position_m.unwrap_or(0.0);
        (f64::from(self.home_sign) * home_m / increment_m).round() as i32
    }

    /// What the drive subtracts from software limits (607Dh), m.
    pub fn limit_offset_m(&self) -> f64 {
        self.home_position_m.filter(|_| self.limits_from_home).unwrap_or(0.0)
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_positive(&[
            ("drive_profile.homing.speed_m_s", self.speed_m_s),
            ("drive_profile.homing.zero_speed_m_s", self.zero_speed_m_s),
            ("drive_profile.homing.acceleration_m_s2", self.acceleration_m_s2),
            ("drive_profile.homing.tolerance_m", self.tolerance_m),
        ])?;
        if !matches!(self.home_sign, -1 | 1) {
            let need = "use -1 (6064h becomes minus the offset) or 1";
            return Err(ScenarioError::bad("drive_profile.homing.home_sign", &self.home_sign, need));
        }
        if self.home_position_m.is_some_and(|home_m| !home_m.is_finite()) {
            let need = "use a finite number";
            return Err(ScenarioError::bad("drive_profile.homing.home_position_m", &f64::NAN, need));
        }
        Ok(())
    }
}
