//! The drives with their encoders: `[drives]`.

use std::path::PathBuf;

use masseter_model::geometry::LEGS;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use toml::Table;

use super::error::ScenarioError;
use super::need::{keyed, require_positive, require_within};
use super::quirks::QuirkConfig;

/// Increments of encoders: with a coarser one the drives are never as near to their targets as the following limit
/// asks, m.
const FINEST_M: f64 = 1e-12;
const COARSEST_M: f64 = 1e-5;
/// Most noise of an encoder, m.
const NOISIEST_M: f64 = 1e-3;

/// A servo drive with its encoder. Scales and limits hold for real ones too, gains and noise for emulated ones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveConfig {
    /// Force at 1000 ‰ of the torque objects (6077), N.
    pub rated_force_n: f64,
    /// Force limit of the drive, N.
    pub max_force_n: f64,
    /// Velocity limit of the drive, m/s.
    pub max_velocity_m_s: f64,
    /// Largest change of the targets' velocity that the master sends, m/s².
    pub max_acceleration_m_s2: f64,
    /// Deceleration of the quick-stop ramp (6085), m/s². The drive's unit of acceleration is taken to be one increment of
    /// its position a second squared.
    pub quick_stop_deceleration_m_s2: f64,
    /// Following error window (6065), m.
    #[doc(alias("position deviation", "contouring error", "lag error"))]
    pub following_error_m: f64,
    /// How long the window may be exceeded (6066), ms.
    #[doc(alias = "following error time out")]
    pub following_error_timeout_ms: u16,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Gain of the velocity loop, N per m/s.
    pub velocity_gain_n_s_per_m: f64,
    /// Integral time of the velocity loop, s.
    pub velocity_integral_time_s: f64,
    /// One increment of the encoder, m.
    pub encoder_resolution_m: f64,
    /// Standard deviation of the encoder's noise, m.
    pub encoder_noise_m: f64,
}

impl DriveConfig {
    /// The increments of the encoder nearest to a length in m; also for m/s and m/s².
    pub fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }
}

/// The drives of slides and of legs; a key that a table does not have keeps its default.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DrivesConfig {
    /// File with the non-volatile memory of the emulated drives; when absent they forget everything at the end.
    pub memory: Option<PathBuf>,
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

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        macro_rules! of_both {
            ($($field:ident)+) => {
                [keyed!("drives.slide", self.slide, $($field)+), keyed!("drives.leg", self.leg, $($field)+)]
            };
        }
        let positive = of_both!(
            rated_force_n max_force_n max_velocity_m_s max_acceleration_m_s2 quick_stop_deceleration_m_s2
            following_error_m position_gain_per_s velocity_gain_n_s_per_m velocity_integral_time_s
        );
        require_positive(positive.as_flattened())?;
        let increments = of_both!(encoder_resolution_m).map(|[(key, m)]| (key, m, FINEST_M, COARSEST_M));
        require_within(&increments)?;
        let noise = of_both!(encoder_noise_m).map(|[(key, value_m)]| (key, value_m, 0.0, NOISIEST_M));
        require_within(&noise)?;
        for (number, quirk) in self.quirk.iter().enumerate() {
            quirk.validate().map_err(|error| error.of_entry(number))?;
        }
        Ok(())
    }
}
