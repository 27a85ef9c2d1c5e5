//! The parameters of the mechanism's dynamics with their defaults. Their ranges are those of a scenario.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};

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

section! {
    /// What limits and loosens the axes. The default stops are steel on steel: 0.1 mm at 1 kN, damped so that a mass of a
    /// kilogram does not bounce.
    #[derive(Copy)]
    pub struct AxesConfig {
        /// Distance from each end of a stroke to the end stop behind it, m.
        pub stop_beyond_m: f64 = 0.002,
        /// Stiffness of an end stop, N/m.
        pub stop_stiffness_n_per_m: f64 = 1e7,
        /// Damping of an end stop, N per m/s.
        pub stop_damping_n_s_per_m: f64 = 5e3,
        /// Play between drive and slide, m.
        pub slide_play_m: f64 = 0.0,
        /// Play between drive and leg, m.
        pub leg_play_m: f64 = 0.0,
    }
}

section! {
    /// The moving masses and their friction.
    #[derive(Copy)]
    pub struct DynamicsConfig {
        /// Integration step of the mechanism and of the drives' inner loops, ns.
        pub step_ns: u64 = 125_000,
        /// Carriage, which a slide moves, kg.
        pub carriage_mass_kg: f64 = 0.7,
        /// Cylinder of a leg, which turns with the hinge, kg.
        pub cylinder_mass_kg: f64 = 0.5,
        /// Its centre of mass on the leg's axis, above the hinge, m.
        pub cylinder_centre_m: f64 = 0.09,
        /// Its inertia about the centre of mass, for a turn of the hinge, kg m².
        pub cylinder_inertia_kg_m2: f64 = 1.35e-3,
        /// Rod of a leg, which slides in the cylinder and ends in the ball, kg.
        pub rod_mass_kg: f64 = 0.4,
        /// Its centre of mass on the leg's axis, behind the ball, m.
        pub rod_centre_m: f64 = 0.1,
        /// Its inertia about the centre of mass, for a turn of the hinge, kg m².
        pub rod_inertia_kg_m2: f64 = 1.333_33e-3,
        /// Platform with the lower jaw, kg.
        pub platform_mass_kg: f64 = 0.5,
        /// Its centre of mass in the platform frame, m.
        pub platform_centre_m: [f64; 3] = [0.0; 3],
        /// Elements xx, yy, zz, xy, xz, yz of its inertia tensor about the centre of mass, platform axes, kg m².
        pub platform_inertia_kg_m2: [f64; 6] = [2.0e-4, 2.0e-4, 3.5e-4, 0.0, 0.0, 0.0],
        /// Coulomb friction of a slide, N; of a leg a quarter of it.
        pub slide_friction_n: f64 = 5.0,
        /// Viscous friction of every axis, N per m/s.
        pub viscous_friction_n_s_per_m: f64 = 20.0,
        /// End stops and play.
        pub axes: AxesConfig = AxesConfig::default(),
        /// Friction under load.
        pub friction: FrictionConfig = FrictionConfig::default(),
        /// Gravity along −z, m/s².
        pub gravity_m_s2: f64 = 9.81,
        /// Length of the legs when the rig is switched on, m.
        pub initial_leg_m: f64 = 0.29,
        /// Where the platform is then beside its place above the middle of the slides, base axes, m.
        pub initial_offset_m: [f64; 3] = [0.0; 3],
    }
}

impl DynamicsConfig {
    /// Valid integration steps: short enough for the stiffest parts, long enough for the computing time, ns.
    pub const STEPS_NS: RangeInclusive<u64> = 10_000..=250_000;
}
