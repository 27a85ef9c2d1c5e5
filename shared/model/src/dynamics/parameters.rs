//! The parameters of the mechanism's dynamics with their defaults and ranges. The scenario checks the ranges.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

/// Masses of a mechanism that fits on a table, kg. Beyond them the equations of motion lose their digits.
const LEAST_KG: f64 = 0.001;
const MOST_KG: f64 = 100.0;
/// The largest inertia: the largest mass at a length of 0.3 m, kg m².
const MOST_KG_M2: f64 = 10.0;
/// Beyond the strokes of a mechanism on a table, m.
const FURTHEST_M: f64 = 0.5;
/// Twice what the drives can push, N.
const MOST_FRICTION_N: f64 = 1000.0;
/// The drives' whole force at 10 mm/s, N per m/s.
const MOST_VISCOUS_N_S_PER_M: f64 = 50_000.0;
/// Ten times the Earth's, for tests of the drives, m/s².
const MOST_GRAVITY_M_S2: f64 = 100.0;

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
        /// How friction depends on speed. `smooth`: an axis at rest creeps under a load; `lugre`: bristles hold it;
        /// `none`: no friction, not even that of `[dynamics]`.
        pub model: FrictionModel = FrictionModel::Smooth,
        /// Friction coefficient of the slides' guides: a ball rail, twice its catalogue value when installed.
        pub guide_coefficient: f64 = 0.005 => Within(0.0, 1.0),
        /// Distance between the bearing blocks of a carriage.
        pub block_spacing_m: f64 = 0.08 => Within(0.005, 1.0),
        /// Normal force that a moment causes, in moments divided by the distance of the blocks.
        pub block_factor: f64 = 2.0 => Within(0.0, 10.0),
        /// Breakaway friction divided by Coulomb friction.
        pub breakaway_ratio: f64 = 1.2 => Within(1.0, 3.0),
        /// Speed at which breakaway friction is reached.
        pub breakaway_speed_m_s: f64 = 0.01 => Within(0.0001, 0.1),
        /// Share of the force that the screw of a slide transmits.
        pub slide_screw_efficiency: f64 = 0.9 => Within(0.1, 1.0),
        /// Share of the force that the screw of a leg transmits.
        pub leg_screw_efficiency: f64 = 0.9 => Within(0.1, 1.0),
        /// Friction coefficient of hinges and ball joints.
        pub joint_coefficient: f64 = 0.1 => Within(0.0, 1.0),
        /// Radius of a hinge's journal.
        pub hinge_radius_m: f64 = 0.005 => Within(0.0, 0.05),
        /// Radius of a ball.
        pub ball_radius_m: f64 = 0.01 => Within(0.0, 0.05),
        /// `lugre`: deflection of the bristles at which an axis slips.
        pub bristle_deflection_m: f64 = 1e-5 => Within(1e-7, 0.001),
        /// `lugre`: damping ratio of an axis on its bristles.
        pub bristle_damping_ratio: f64 = 0.7 => Within(0.0, 10.0),
    }
}

section! {
    /// What limits and loosens the axes. The default stops are steel on steel: 0.1 mm at 1 kN, damped so that a mass of a
    /// kilogram does not bounce.
    #[derive(Copy)]
    pub struct AxesConfig {
        /// Distance from each end of a stroke to the end stop behind it.
        pub stop_beyond_m: f64 = 0.002 => Within(0.0, 0.1),
        /// Stiffness of an end stop.
        pub stop_stiffness_n_per_m: f64 = 1e7 => Within(1000.0, 1e9),
        /// Damping of an end stop.
        pub stop_damping_n_s_per_m: f64 = 5e3 => Within(0.0, 1e6),
        /// Play between drive and slide.
        pub slide_play_m: f64 = 0.0 => Within(0.0, 0.02),
        /// Play between drive and leg.
        pub leg_play_m: f64 = 0.0 => Within(0.0, 0.02),
    }
}

section! {
    /// The moving masses and their friction.
    #[derive(Copy)]
    pub struct DynamicsConfig {
        /// Integration step of the mechanism and of the drives' inner loops.
        pub step_ns: u64 = 125_000 => Within(*Self::STEPS_NS.start() as f64, *Self::STEPS_NS.end() as f64),
        /// Carriage, which a slide moves.
        pub carriage_mass_kg: f64 = 0.7 => Within(LEAST_KG, MOST_KG),
        /// Cylinder of a leg, which turns with the hinge.
        pub cylinder_mass_kg: f64 = 0.5 => Within(LEAST_KG, MOST_KG),
        /// Its centre of mass on the leg's axis, above the hinge.
        pub cylinder_centre_m: f64 = 0.09 => Within(-FURTHEST_M, FURTHEST_M),
        /// Its inertia about the centre of mass, for a turn of the hinge.
        pub cylinder_inertia_kg_m2: f64 = 1.35e-3 => Within(0.0, MOST_KG_M2),
        /// Rod of a leg, which slides in the cylinder and ends in the ball.
        pub rod_mass_kg: f64 = 0.4 => Within(LEAST_KG, MOST_KG),
        /// Its centre of mass on the leg's axis, behind the ball.
        pub rod_centre_m: f64 = 0.1 => Within(-FURTHEST_M, FURTHEST_M),
        /// Its inertia about the centre of mass, for a turn of the hinge.
        pub rod_inertia_kg_m2: f64 = 1.333_33e-3 => Within(0.0, MOST_KG_M2),
        /// Platform with the lower jaw.
        pub platform_mass_kg: f64 = 0.5 => Within(LEAST_KG, MOST_KG),
        /// Its centre of mass, platform frame.
        pub platform_centre_m: [f64; 3] = [0.0; 3] => Within(-FURTHEST_M, FURTHEST_M),
        /// Elements xx, yy, zz, xy, xz, yz of its inertia tensor about the centre of mass, platform axes.
        pub platform_inertia_kg_m2: [f64; 6] = [2.0e-4, 2.0e-4, 3.5e-4, 0.0, 0.0, 0.0]
            => Within(-MOST_KG_M2, MOST_KG_M2) "of a real body",
        /// Coulomb friction of a slide without load; of a leg a quarter of it.
        pub slide_friction_n: f64 = 5.0 => Within(0.0, MOST_FRICTION_N),
        /// Viscous friction of every axis.
        pub viscous_friction_n_s_per_m: f64 = 20.0 => Within(0.0, MOST_VISCOUS_N_S_PER_M),
        /// End stops and play.
        pub axes: AxesConfig = AxesConfig::default(),
        /// Friction under load.
        pub friction: FrictionConfig = FrictionConfig::default(),
        /// Gravity along −z.
        pub gravity_m_s2: f64 = 9.81 => Within(0.0, MOST_GRAVITY_M_S2),
        /// Length of the legs when the rig is switched on.
        pub initial_leg_m: f64 = 0.29 => Positive "level within the strokes",
        /// Where the level platform is then, beside its place above the middle of the slides; base axes.
        pub initial_offset_m: [f64; 3] = [0.0; 3] => Within(-FURTHEST_M, FURTHEST_M) "within the strokes",
    }
}

impl DynamicsConfig {
    /// Valid integration steps: short enough for the stiffest parts, long enough for the computing time, ns.
    pub const STEPS_NS: RangeInclusive<u64> = 10_000..=250_000;
}
