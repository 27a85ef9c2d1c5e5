//! Friction that grows with the load: `[dynamics.friction]`.
//!
//! Friction without load is in `[dynamics]`.

use masseter_model::dynamics::{FrictionConfig, FrictionModel};

use super::error::ScenarioError;
use super::need::require_within;

/// A screw of less efficiency hides too much of a load that drives it.
const LEAST_SHOWN: f64 = 0.7;

/// Refuses screws through which the forces of the drives do not show the load.
pub(super) fn require_open_screws(friction: &FrictionConfig) -> Result<(), ScenarioError> {
    let need = "use at least 0.7 with [force_estimate] or [force_control], or control by a load cell: this screw hides the load from \
                its drive";
    for (key, efficiency) in [
        ("dynamics.friction.slide_screw_efficiency", friction.slide_screw_efficiency),
        ("dynamics.friction.leg_screw_efficiency", friction.leg_screw_efficiency),
    ] {
        if friction.model != FrictionModel::None && efficiency < LEAST_SHOWN {
            return Err(ScenarioError::bad(key, &efficiency, need));
        }
    }
    Ok(())
}

pub(super) fn validate(friction: &FrictionConfig) -> Result<(), ScenarioError> {
    require_within(&[
        ("dynamics.friction.guide_coefficient", friction.guide_coefficient, 0.0, 1.0),
        ("dynamics.friction.block_spacing_m", friction.block_spacing_m, 0.005, 1.0),
        ("dynamics.friction.block_factor", friction.block_factor, 0.0, 10.0),
        ("dynamics.friction.breakaway_ratio", friction.breakaway_ratio, 1.0, 3.0),
        ("dynamics.friction.breakaway_speed_m_s", friction.breakaway_speed_m_s, 1e-4, 0.1),
        ("dynamics.friction.slide_screw_efficiency", friction.slide_screw_efficiency, 0.1, 1.0),
        ("dynamics.friction.leg_screw_efficiency", friction.leg_screw_efficiency, 0.1, 1.0),
        ("dynamics.friction.joint_coefficient", friction.joint_coefficient, 0.0, 1.0),
        ("dynamics.friction.hinge_radius_m", friction.hinge_radius_m, 0.0, 0.05),
        ("dynamics.friction.ball_radius_m", friction.ball_radius_m, 0.0, 0.05),
        ("dynamics.friction.bristle_deflection_m", friction.bristle_deflection_m, 1e-7, 1e-3),
        ("dynamics.friction.bristle_damping_ratio", friction.bristle_damping_ratio, 0.0, 10.0),
    ])
}
