//! The emulated mechanism's masses and friction: `[dynamics]`.

use std::ops::RangeInclusive;

use super::error::ScenarioError;
use super::need::{keyed, require_not_negative, require_positive, require_within};

/// Masses of a mechanism that fits on a table, kg. Beyond them the equations of motion lose their digits.
const LEAST_KG: f64 = 0.001;
const MOST_KG: f64 = 100.0;
/// The largest inertia: the largest mass at a length of 0.3 m, kg m².
const MOST_KG_M2: f64 = 10.0;
/// Beyond the strokes of a mechanism on a table, m.
const FURTHEST_M: f64 = 0.5;
/// Ten times the Earth's, for tests of the drives, m/s².
const MOST_GRAVITY_M_S2: f64 = 100.0;

section! {
    /// The moving masses and their friction.
    #[derive(Copy)]
    pub struct DynamicsConfig {
        /// Integration step of the mechanism and of the drives' inner loops, ns; the more friction, the shorter.
        pub step_ns: u64 = 125_000,
        /// Carriage with the fixed part of its leg, moved by a slide, kg.
        pub carriage_mass_kg: f64 = 1.2,
        /// Telescoping part of a leg, kg.
        pub rod_mass_kg: f64 = 0.4,
        /// Inertia of a leg about its hinge, kg m².
        pub leg_inertia_kg_m2: f64 = 0.03,
        /// Platform with the lower jaw, kg.
        pub platform_mass_kg: f64 = 0.5,
        /// Principal inertia of the platform about its origin, platform axes, kg m².
        pub platform_inertia_kg_m2: [f64; 3] = [2.0e-4, 2.0e-4, 3.5e-4],
        /// Coulomb friction of a slide, N; of a leg a quarter of it.
        pub slide_friction_n: f64 = 8.0,
        /// Viscous friction of every axis, N per m/s.
        pub viscous_friction_n_s_per_m: f64 = 20.0,
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

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let Self { carriage_mass_kg, rod_mass_kg, platform_mass_kg, leg_inertia_kg_m2, gravity_m_s2, .. } =
            *self;
        require_within(&[
            ("dynamics.carriage_mass_kg", carriage_mass_kg, LEAST_KG, MOST_KG),
            ("dynamics.rod_mass_kg", rod_mass_kg, LEAST_KG, MOST_KG),
            ("dynamics.platform_mass_kg", platform_mass_kg, LEAST_KG, MOST_KG),
            ("dynamics.leg_inertia_kg_m2", leg_inertia_kg_m2, 0.0, MOST_KG_M2),
            ("dynamics.gravity_m_s2", gravity_m_s2, 0.0, MOST_GRAVITY_M_S2),
        ])?;
        let inertia = self.platform_inertia_kg_m2;
        require_within(&inertia.map(|kg_m2| ("dynamics.platform_inertia_kg_m2", kg_m2, 0.0, MOST_KG_M2)))?;
        let offset_m = self.initial_offset_m;
        require_within(&offset_m.map(|m| ("dynamics.initial_offset_m", m, -FURTHEST_M, FURTHEST_M)))?;
        require_positive(&keyed!("dynamics", self, initial_leg_m))?;
        require_not_negative(&keyed!("dynamics", self, slide_friction_n viscous_friction_n_s_per_m))?;
        if !Self::STEPS_NS.contains(&self.step_ns) {
            return Err(ScenarioError::bad("dynamics.step_ns", &self.step_ns, "use 10000 to 250000 ns"));
        }
        Ok(())
    }
}
