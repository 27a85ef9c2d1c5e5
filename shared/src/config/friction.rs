//! Friction that grows with the load: `[dynamics.friction]`.
//!
//! Friction without load is in `[dynamics]`.

use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::need::require_within;

/// How friction depends on speed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrictionModel {
    /// Stribeck curve through zero: an axis at rest creeps under a load.
    #[default]
    Smooth,
    /// No friction at all, `[dynamics]` included.
    None,
    /// LuGre: bristles hold an axis at rest.
    Lugre,
}

section! {
    /// Load-dependent friction of guides, screws, hinges and ball joints.
    #[derive(Copy)]
    pub struct FrictionConfig {
        /// How friction depends on speed.
        pub model: FrictionModel = FrictionModel::Smooth,
        /// Friction coefficient of the slides' guides: a ball rail, twice its catalogue value when installed.
        pub guide_coefficient: f64 = 0.005,
        /// Distance between the bearing blocks of a carriage, m.
        pub block_spacing_m: f64 = 0.08,
        /// Normal force that a moment causes, in moments divided by the distance of the blocks.
        pub block_factor: f64 = 2.0,
        /// Breakaway friction divided by Coulomb friction.
        pub breakaway_ratio: f64 = 1.2,
        /// Speed at which the breakaway friction is reached, m/s.
        pub breakaway_speed_m_s: f64 = 0.01,
        /// Share of the force that the screw of a slide transmits.
        pub slide_screw_efficiency: f64 = 0.9,
        /// Share of the force that the screw of a leg transmits.
        pub leg_screw_efficiency: f64 = 0.9,
        /// Friction coefficient of hinges and ball joints.
        pub joint_coefficient: f64 = 0.1,
        /// Radius of a hinge's journal, m.
        pub hinge_radius_m: f64 = 0.005,
        /// Radius of a ball, m.
        pub ball_radius_m: f64 = 0.01,
        /// LuGre: deflection of the bristles at which an axis slips, m.
        pub bristle_deflection_m: f64 = 1e-5,
        /// LuGre: damping ratio of an axis on its bristles.
        pub bristle_damping_ratio: f64 = 0.7,
    }
}

/// A screw of less efficiency hides too much of a load that drives it.
const LEAST_SHOWN: f64 = 0.7;

impl FrictionConfig {
    /// Refuses screws through which the forces of the drives do not show the load.
    pub(super) fn require_open_screws(&self) -> Result<(), ScenarioError> {
        let need = "use at least 0.7 with [force_estimate] or [force_control], or control by a load cell: this screw hides the load from \
                    its drive";
        for (key, efficiency) in [
            ("dynamics.friction.slide_screw_efficiency", self.slide_screw_efficiency),
            ("dynamics.friction.leg_screw_efficiency", self.leg_screw_efficiency),
        ] {
            if self.model != FrictionModel::None && efficiency < LEAST_SHOWN {
                return Err(ScenarioError::bad(key, &efficiency, need));
            }
        }
        Ok(())
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_within(&[
            ("dynamics.friction.guide_coefficient", self.guide_coefficient, 0.0, 1.0),
            ("dynamics.friction.block_spacing_m", self.block_spacing_m, 0.005, 1.0),
            ("dynamics.friction.block_factor", self.block_factor, 0.0, 10.0),
            ("dynamics.friction.breakaway_ratio", self.breakaway_ratio, 1.0, 3.0),
            ("dynamics.friction.breakaway_speed_m_s", self.breakaway_speed_m_s, 1e-4, 0.1),
            ("dynamics.friction.slide_screw_efficiency", self.slide_screw_efficiency, 0.1, 1.0),
            ("dynamics.friction.leg_screw_efficiency", self.leg_screw_efficiency, 0.1, 1.0),
            ("dynamics.friction.joint_coefficient", self.joint_coefficient, 0.0, 1.0),
            ("dynamics.friction.hinge_radius_m", self.hinge_radius_m, 0.0, 0.05),
            ("dynamics.friction.ball_radius_m", self.ball_radius_m, 0.0, 0.05),
            ("dynamics.friction.bristle_deflection_m", self.bristle_deflection_m, 1e-7, 1e-3),
            ("dynamics.friction.bristle_damping_ratio", self.bristle_damping_ratio, 0.0, 10.0),
        ])
    }
}
