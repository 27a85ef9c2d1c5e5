//! Food between the teeth of the emulated jaw: `[food]`.

use serde::{Deserialize, Serialize};

use super::ScenarioError;

/// A piece of food, as a body that resists being bitten. The defaults are a soft round piece of 10 mm between the
/// first molars on the left side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FoodConfig {
    /// Where the lower jaw bites on it, in the platform frame, m.
    pub point_m: [f64; 3],
    /// Thickness of a fresh piece, m.
    pub thickness_m: f64,
    /// Force against compression, N/m.
    pub stiffness_n_per_m: f64,
    /// Force against the speed of compression, N per m/s.
    pub damping_n_s_per_m: f64,
    /// Elastic force at which it yields, N; what yields stays flat until the mouth opens wider than a fresh piece is
    /// thick.
    pub yield_n: f64,
}

impl Default for FoodConfig {
    fn default() -> Self {
        Self {
            point_m: [0.0024, 0.0248, 0.0],
            thickness_m: 0.010,
            stiffness_n_per_m: 3500.0,
            damping_n_s_per_m: 10.0,
            yield_n: 35.0,
        }
    }
}

impl FoodConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let bad = |key, value: f64, need: &str| {
            Err(ScenarioError::BadValue { key, value: value.to_string(), need: need.to_owned() })
        };
        if let Some(&value) = self.point_m.iter().find(|value| !value.is_finite()) {
            return bad("food.point_m", value, "use finite coordinates");
        }
        // Far from what the integration of the mechanism could not resolve.
        let ranges = [
            ("food.thickness_m", self.thickness_m, 1e-4, 0.05),
            ("food.stiffness_n_per_m", self.stiffness_n_per_m, 1.0, 1e6),
            ("food.damping_n_s_per_m", self.damping_n_s_per_m, 0.0, 1e3),
            ("food.yield_n", self.yield_n, 0.1, 1500.0),
        ];
        for (key, value, least, most) in ranges {
            if !(least..=most).contains(&value) {
                return bad(key, value, &format!("use {least} to {most}"));
            }
        }
        Ok(())
    }
}
