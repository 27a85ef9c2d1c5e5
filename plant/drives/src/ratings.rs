//! The abilities of a drive.

use serde::{Deserialize, Serialize};

/// The abilities of a drive, and the gains of its loops. The default is a spindle drive of 500 N that counts in
/// micrometres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Ratings {
    /// Force at 1000 ‰ of the torque objects (6077h), N.
    pub rated_force_n: f64,
    /// Force limit, N.
    pub max_force_n: f64,
    /// Velocity limit, m/s.
    pub max_velocity_m_s: f64,
    /// Deceleration of the quick-stop ramp (6085h), m/s².
    pub quick_stop_deceleration_m_s2: f64,
    /// Following error window (6065h), m.
    pub following_error_m: f64,
    /// How long the window may be exceeded (6066h), ms.
    pub following_error_timeout_ms: u16,
    /// Gain of the position loop, 1/s.
    pub position_gain_per_s: f64,
    /// Gain of the velocity loop, N per m/s.
    pub velocity_gain_n_s_per_m: f64,
    /// Integral time of the velocity loop, s.
    pub velocity_integral_time_s: f64,
    /// One increment of the encoder, m.
    pub encoder_resolution_m: f64,
    /// Standard deviation of the encoder's noise, m. The position window (6067h) follows from the noise; the caller adds
    /// the noise to what the encoder shows.
    pub encoder_noise_m: f64,
}

impl Default for Ratings {
    fn default() -> Self {
        Self {
            rated_force_n: 500.0,
            max_force_n: 1000.0,
            max_velocity_m_s: 0.4,
            quick_stop_deceleration_m_s2: 10.0,
            following_error_m: 0.002,
            following_error_timeout_ms: 20,
            position_gain_per_s: 100.0,
            velocity_gain_n_s_per_m: 600.0,
            velocity_integral_time_s: 0.01,
            encoder_resolution_m: 1e-6,
            encoder_noise_m: 0.2e-6,
        }
    }
}

impl Ratings {
    /// The increments of the encoder nearest to a length in m; also for m/s and m/s².
    pub(crate) fn increments(&self, metres: f64) -> f64 {
        (metres / self.encoder_resolution_m).round()
    }
}
