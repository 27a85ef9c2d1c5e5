//! Where the jaw sits on the platform: `[jaw]`.
//!
//! Values are checked by whoever builds the trajectory, not here.

use serde::{Deserialize, Serialize};

/// Where the lower jaw sits on the platform, and the mandible's own dimensions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct JawConfig {
    /// Length of all three legs at the closed pose, slides in the middle, metres.
    pub closed_leg_m: f64,
    /// Shift of the closed pose from there, base frame, metres. A jaw that opens far back gains
    /// stroke by being closed further forward.
    pub closed_offset_m: [f64; 3],
    /// The incisal point (origin of the jaw frame) in the platform frame, metres.
    /// By default corner A₁ of the paper's platform.
    pub reference_point_m: [f64; 3],
    /// Side of Bonwill's triangle (both condyles and the incisal point), metres.
    pub bonwill_side_m: f64,
    /// Balkwill angle between Bonwill's triangle and the occlusal plane, degrees.
    pub balkwill_angle_deg: f64,
}

impl Default for JawConfig {
    fn default() -> Self {
        Self {
            closed_leg_m: 0.2974,
            closed_offset_m: [0.0; 3],
            reference_point_m: [0.05 / 3f64.sqrt(), 0.0, 0.0],
            bonwill_side_m: 0.100,
            balkwill_angle_deg: 22.5,
        }
    }
}
