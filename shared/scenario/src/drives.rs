//! The drives with their encoders, and the scale of their numbers: `[drives]`.

use std::path::PathBuf;

use masseter_model::geometry::{AXIS_NAMES, LEGS};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use toml::Table;

use super::drive_profile::{AccelerationUnit, DriveProfile, VelocityUnit};
use super::error::{Checked, ranges_of, require, require_each};
use super::quirks::QuirkConfig;

/// Range of an encoder's increment, m. With a coarser encoder the drives never come within the following limit of their
/// targets.
const FINEST_M: f64 = 1e-12;
const COARSEST_M: f64 = 1e-5;
/// Most noise of an encoder, m.
const NOISIEST_M: f64 = 1e-3;
/// The least limit of a second encoder, in standard deviations of the noise and in increments, so that neither causes a
/// fault.
const ENCODERS_APART: f64 = 10.0;

keys! {
    /// A servo drive with its encoder. Scales and limits hold for real ones too, gains and noise for emulated ones.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct DriveConfig {
        /// Force at 1000 ‰ of the torque objects (6077).
        pub rated_force_n: f64 => Positive,
        /// Force limit of the drive.
        pub max_force_n: f64 => Positive,
        /// Velocity limit of the drive; the master refuses commands beyond it.
        pub max_velocity_m_s: f64 => Positive,
        /// Acceleration beyond which the master refuses commands. The default motions take 1.3 m/s², and pose control up to
        /// 41 m/s² after stalls of the machine. Targets may stop at once and go on as before within twice the time-out of
        /// commands.
        pub max_acceleration_m_s2: f64 => Positive,
        /// Deceleration of the quick-stop ramp (6085). The drive's unit of acceleration is taken to be one increment of its
        /// position a second squared.
        pub quick_stop_deceleration_m_s2: f64 => Positive,
        /// Following error window (6065).
        #[doc(alias("position deviation", "contouring error", "lag error"))]
        pub following_error_m: f64 => Positive,
        /// Longest time outside the window (6066).
        #[doc(alias = "following error time out")]
        pub following_error_timeout_ms: u16,
        /// Gain of the position loop.
        pub position_gain_per_s: f64 => Positive,
        /// Gain of the velocity loop.
        pub velocity_gain_n_s_per_m: f64 => Positive,
        /// Integral time of the velocity loop.
        pub velocity_integral_time_s: f64 => Positive,
        /// One increment of the encoder.
        pub encoder_resolution_m: f64 => Within(FINEST_M, COARSEST_M) "a stroke's end must fit into 32 bits",
        /// Standard deviation of the encoder's noise.
        pub encoder_noise_m: f64 => Within(0.0, NOISIEST_M),
    }
}

impl DriveConfig {
    /// The increments of the encoder nearest to a length in m; also for m/s and m/s².
    pub fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }

    /// The stiffness of an axis that its loops hold at rest, N/m: the part of their force that is in phase with a
    /// deviation x, as they answer −K (K_p + s) (1 + 1/(T s)) x.
    pub fn stiffness_n_per_m(&self) -> f64 {
        self.velocity_gain_n_s_per_m * (self.position_gain_per_s + 1.0 / self.velocity_integral_time_s)
    }
}

keys! {
    /// The drives of slides and of legs; a key that a table does not have keeps its default.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct DrivesConfig {
        /// File with the non-volatile memory of the emulated drives: what 1010h has stored, and the serial numbers. It is
        /// read when the drives are switched on. Tools and `masseter plant --emulate` write it once a drive has saved; a
        /// run only reads it.
        pub memory: Option<PathBuf> => "a path, relative to the scenario's folder",
        /// Drives of d₁ d₂ d₃.
        #[serde(deserialize_with = "slide")]
        pub slide: DriveConfig,
        /// Drives of l₁ l₂ l₃.
        #[serde(deserialize_with = "leg")]
        pub leg: DriveConfig,
        /// What emulated drives do otherwise than the standard.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        pub quirk: Vec<QuirkConfig>,
    }
}

fn slide<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().slide, table)
}

fn leg<'de, D: Deserializer<'de>>(table: D) -> Result<DriveConfig, D::Error> {
    over(DrivesConfig::default().leg, table)
}

fn over<'de, D: Deserializer<'de>>(defaults: DriveConfig, given: D) -> Result<DriveConfig, D::Error> {
    let mut table = Table::try_from(defaults).map_err(Error::custom)?;
    table.extend(Table::deserialize(given)?);
    table.try_into().map_err(Error::custom)
}

impl Default for DrivesConfig {
    fn default() -> Self {
        let leg = DriveConfig {
            rated_force_n: 500.0,
            max_force_n: 1000.0,
            max_velocity_m_s: 0.4,
            max_acceleration_m_s2: 100.0,
            quick_stop_deceleration_m_s2: 10.0,
            following_error_m: 0.002,
            following_error_timeout_ms: 20,
            position_gain_per_s: 100.0,
            velocity_gain_n_s_per_m: 600.0,
            velocity_integral_time_s: 0.01,
            encoder_resolution_m: 1e-6,
            encoder_noise_m: 0.2e-6,
        };
        let slide = DriveConfig {
            rated_force_n: 250.0,
            max_force_n: 500.0,
            max_velocity_m_s: 0.2,
            velocity_gain_n_s_per_m: 2000.0,
            ..leg
        };
        Self { memory: None, slide, leg, quirk: Vec::new() }
    }
}

impl DrivesConfig {
    /// The drive of an axis.
    pub const fn of_axis(&self, axis: usize) -> DriveConfig {
        if axis < LEGS { self.slide } else { self.leg }
    }

    pub(super) fn validate(&self) -> Checked {
        self.slide.check_ranges(ranges_of("drives.slide"))?;
        self.leg.check_ranges(ranges_of("drives.leg"))?;
        require_each(&self.quirk, QuirkConfig::validate)?;
        require_each(&self.quirk, |quirk| self.check_second_encoder(quirk))
    }

    /// Refuses a limit that an encoder without a fault can exceed.
    fn check_second_encoder(&self, quirk: &QuirkConfig) -> Checked {
        let Some(limit_m) = quirk.encoders_apart_m() else { return Ok(()) };
        let drives = (0..AXIS_NAMES.len()).filter(|axis| quirk.is_on(*axis)).map(|axis| self.of_axis(axis));
        let uncertain_m = |drive: DriveConfig| drive.encoder_noise_m.max(drive.encoder_resolution_m);
        let least_m = ENCODERS_APART * drives.map(uncertain_m).fold(0.0, f64::max);
        let need = format!("use at least {least_m}: ten times the encoder's noise and its increment");
        require(limit_m >= least_m, "drives.quirk.limit_m", &limit_m, &need)
    }
}

/// The scales of one axis. Positions have the axis' sign; velocities and accelerations of profiles and limits have none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct AxisScale {
    /// d or l for an increment of 6064h, m: negative on an axis that counts the other way.
    pub increment_m: f64,
    /// A unit of velocity, m/s.
    pub velocity_m_s: f64,
    /// A unit of acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Force for 1 ‰ of the torque objects, N: negative like `increment_m`.
    pub permille_n: f64,
}

impl AxisScale {
    pub(crate) fn new(drive: &DriveConfig, profile: &DriveProfile, axis: usize) -> Self {
        let (length_m, sign) =
            (drive.encoder_resolution_m, if profile.is_reversed(axis) { -1.0 } else { 1.0 });
        // A profile that counts turns has a lead; the checks refuse a profile without one.
        let rpm_m_s = profile.units.travel_per_turn_m().unwrap_or(length_m) / 60.0;
        Self {
            increment_m: sign * length_m,
            velocity_m_s: match profile.units.velocity {
                VelocityUnit::IncrementsS => length_m,
                VelocityUnit::TenthIncrementsS => length_m / 10.0,
                VelocityUnit::Rpm => rpm_m_s,
            },
            acceleration_m_s2: match profile.units.acceleration {
                AccelerationUnit::IncrementsS2 => length_m,
                AccelerationUnit::RpmPerS => rpm_m_s,
            },
            permille_n: sign * drive.rated_force_n / 1000.0,
        }
    }

    /// The increments nearest to d or l, clamped to the range of the number.
    #[inline]
    pub fn increments(&self, position_m: f64) -> i32 {
        (position_m / self.increment_m).round() as i32
    }

    /// d or l at a number of increments, m.
    #[inline]
    pub fn metres(&self, increments: i32) -> f64 {
        f64::from(increments) * self.increment_m
    }

    /// A force in the direction of d or l, in ‰ of the rated force.
    #[inline]
    pub fn permille(&self, force_n: f64) -> i16 {
        (force_n / self.permille_n).round() as i16
    }

    /// A length without a sign, such as a window, in increments.
    #[inline]
    pub fn window(&self, length_m: f64) -> u32 {
        (length_m / self.increment_m.abs()).round() as u32
    }

    /// A velocity without a sign, in the drive's unit: at least 1.
    pub fn velocity(&self, velocity_m_s: f64) -> u32 {
        ((velocity_m_s / self.velocity_m_s).round() as u32).max(1)
    }

    /// An acceleration without a sign, in the drive's unit: at least 1.
    pub fn acceleration(&self, acceleration_m_s2: f64) -> u32 {
        ((acceleration_m_s2 / self.acceleration_m_s2).round() as u32).max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Scenario, UnitsConfig};

    fn scale(units: UnitsConfig, reversed: &[&str]) -> AxisScale {
        let reversed = reversed.iter().map(|&name| name.to_owned()).collect();
        let profile = DriveProfile { reversed, units, ..DriveProfile::default() };
        Scenario { drive_profile: vec![profile], ..Scenario::default() }.scale(3)
    }

    /// 5 mm a turn, 2 µm an increment would be 2500 increments a turn; the default leg has 1 µm.
    #[test]
    fn an_acceleration_counts_in_the_unit_of_the_drive() {
        let units = UnitsConfig {
            acceleration: AccelerationUnit::RpmPerS,
            velocity: VelocityUnit::Rpm,
            gear_ratio: 2.0,
            lead_m: Some(0.006),
        };
        let turns = scale(units, &[]);
        // 3 mm a motor turn: 10 m/s² are 3333.3 turns/s², 200 000 rpm/s.
        assert_eq!((turns.acceleration(10.0), turns.velocity(0.03)), (200_000, 600));
        let increments = scale(UnitsConfig::default(), &[]);
        assert_eq!((increments.acceleration(10.0), increments.velocity(0.03)), (10_000_000, 30_000));
        let tenths = UnitsConfig { velocity: VelocityUnit::TenthIncrementsS, ..UnitsConfig::default() };
        assert_eq!(scale(tenths, &[]).velocity(0.03), 300_000);
    }

    #[test]
    fn a_reversed_axis_has_the_other_sign_and_the_same_windows() {
        let (ahead, back) = (scale(UnitsConfig::default(), &[]), scale(UnitsConfig::default(), &["l1"]));
        assert_eq!((ahead.increments(0.1), back.increments(0.1)), (100_000, -100_000));
        let is_near = |a: f64, b: f64| (a - b).abs() < 1e-15;
        assert!(is_near(ahead.metres(5), 5e-6) && is_near(back.metres(-5), 5e-6));
        assert_eq!((ahead.window(0.002), back.window(0.002)), (2000, 2000));
        assert!(is_near(ahead.permille_n, -back.permille_n));
        let force_n = 40.0 * ahead.permille_n;
        assert_eq!((ahead.permille(force_n), back.permille(force_n)), (40, -40));
    }
}
