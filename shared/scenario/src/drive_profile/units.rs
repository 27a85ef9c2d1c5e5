//! What the numbers of a drive count.

use serde::{Deserialize, Serialize};

use crate::error::ScenarioError;
use crate::need::require_positive;

/// Unit of the drive's velocities (6081h, 6099h).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum VelocityUnit {
    /// Increments of 6064h a second.
    #[default]
    IncrementsS,
    /// Tenths of an increment a second.
    #[serde(rename = "0.1_increments_s")]
    TenthIncrementsS,
    /// Turns of the motor a minute.
    Rpm,
}

/// Unit of the drive's accelerations (6083h to 6085h, 609Ah).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum AccelerationUnit {
    /// Increments of 6064h a second squared.
    #[default]
    IncrementsS2,
    /// Turns of the motor a minute, per second.
    #[serde(rename = "rpm_s")]
    RpmPerS,
}

/// Increments in 60A8h (CiA 303-2: prefix, numerator, denominator).
pub const INCREMENTS: u32 = 0x00B5_0000;

impl VelocityUnit {
    /// The unit in 60A9h (CiA 303-2: prefix, numerator, denominator).
    pub const fn code(self) -> u32 {
        match self {
            Self::IncrementsS => 0x00B5_0300,
            Self::TenthIncrementsS => 0xFFB5_0300,
            Self::Rpm => 0x00B4_4700,
        }
    }
}

impl AccelerationUnit {
    /// Every unit.
    pub const ALL: [Self; 2] = [Self::IncrementsS2, Self::RpmPerS];

    /// The unit in 60AAh (CiA 303-2: prefix, numerator, denominator).
    pub const fn code(self) -> u32 {
        match self {
            Self::IncrementsS2 => 0x00B5_5700,
            Self::RpmPerS => 0x00C0_0300,
        }
    }
}

section! {
    /// What the drive's numbers count. Positions are always increments of 6064h.
    #[derive(Copy)]
    pub struct UnitsConfig {
        /// Unit of velocities.
        pub velocity: VelocityUnit = VelocityUnit::default(),
        /// Unit of accelerations.
        pub acceleration: AccelerationUnit = AccelerationUnit::default(),
        /// Turns of the motor for one of the screw (6091h).
        pub gear_ratio: f64 = 1.0,
        /// Travel of the axis for one turn of the screw (6092h), m; needed where the drive counts turns.
        pub lead_m: Option<f64> = None,
    }
}

impl UnitsConfig {
    /// Travel of the axis for a turn of the motor, m; none where the profile has no lead.
    pub fn travel_per_turn_m(&self) -> Option<f64> {
        Some(self.lead_m? / self.gear_ratio)
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_positive(&[("drive_profile.units.gear_ratio", self.gear_ratio)])?;
        let counts_turns =
            self.velocity == VelocityUnit::Rpm || self.acceleration == AccelerationUnit::RpmPerS;
        match self.lead_m {
            Some(lead_m) => require_positive(&[("drive_profile.units.lead_m", lead_m)]),
            None if counts_turns => {
                let need = "enter the travel of a turn of the screw: the drive counts turns of the motor";
                Err(ScenarioError::bad("drive_profile.units.lead_m", &"none", need))
            }
            None => Ok(()),
        }
    }
}
