//! The emulated mechanism's masses and friction: `[dynamics]`.

use std::ops::RangeInclusive;

use nalgebra::Matrix3;

use super::axes::AxesConfig;
use super::error::ScenarioError;
use super::friction::{FrictionConfig, FrictionModel};
use super::need::{keyed, require_positive, require_within};

/// Masses of a mechanism that fits on a table, kg. Beyond them the equations of motion lose their digits.
const LEAST_KG: f64 = 0.001;
const MOST_KG: f64 = 100.0;
/// The largest inertia: the largest mass at a length of 0.3 m, kg m².
const MOST_KG_M2: f64 = 10.0;
/// Share by which a flat body's largest inertia may exceed the sum of the others, for rounding.
const ROUNDING: f64 = 1e-6;
/// Beyond the strokes of a mechanism on a table, m.
const FURTHEST_M: f64 = 0.5;
/// Twice what the drives can push, N.
const MOST_FRICTION_N: f64 = 1000.0;
/// The drives' whole force at 10 mm/s, N per m/s.
const MOST_VISCOUS_N_S_PER_M: f64 = 50_000.0;
/// Ten times the Earth's, for tests of the drives, m/s².
const MOST_GRAVITY_M_S2: f64 = 100.0;

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

    /// The same mechanism without friction.
    #[must_use]
    pub fn without_friction(self) -> Self {
        Self { friction: FrictionConfig { model: FrictionModel::None, ..self.friction }, ..self }
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let masses = keyed!("dynamics", self, carriage_mass_kg cylinder_mass_kg rod_mass_kg platform_mass_kg);
        require_within(&masses.map(|(key, kg)| (key, kg, LEAST_KG, MOST_KG)))?;
        let inertias = keyed!("dynamics", self, cylinder_inertia_kg_m2 rod_inertia_kg_m2);
        require_within(&inertias.map(|(key, kg_m2)| (key, kg_m2, 0.0, MOST_KG_M2)))?;
        let centres = keyed!("dynamics", self, cylinder_centre_m rod_centre_m);
        let centre_m = self.platform_centre_m.map(|m| ("dynamics.platform_centre_m", m));
        for near in [&centres[..], &centre_m] {
            near.iter().try_for_each(|&(key, m)| require_within(&[(key, m, -FURTHEST_M, FURTHEST_M)]))?;
        }
        require_inertia("dynamics.platform_inertia_kg_m2", self.platform_inertia_kg_m2)?;
        require_within(&[("dynamics.gravity_m_s2", self.gravity_m_s2, 0.0, MOST_GRAVITY_M_S2)])?;
        let offset_m = self.initial_offset_m;
        require_within(&offset_m.map(|m| ("dynamics.initial_offset_m", m, -FURTHEST_M, FURTHEST_M)))?;
        require_positive(&keyed!("dynamics", self, initial_leg_m))?;
        require_within(&[
            ("dynamics.slide_friction_n", self.slide_friction_n, 0.0, MOST_FRICTION_N),
            (
                "dynamics.viscous_friction_n_s_per_m",
                self.viscous_friction_n_s_per_m,
                0.0,
                MOST_VISCOUS_N_S_PER_M,
            ),
        ])?;
        self.axes.validate()?;
        self.friction.validate()?;
        if !Self::STEPS_NS.contains(&self.step_ns) {
            return Err(ScenarioError::bad("dynamics.step_ns", &self.step_ns, "use 10000 to 250000 ns"));
        }
        Ok(())
    }
}

/// Refuses a tensor that no body has: one that is not positive definite, or a principal inertia larger than the two others
/// together.
fn require_inertia(key: &'static str, elements: [f64; 6]) -> Result<(), ScenarioError> {
    require_within(&elements.map(|kg_m2| (key, kg_m2, -MOST_KG_M2, MOST_KG_M2)))?;
    let [xx, yy, zz, xy, xz, yz] = elements;
    let mut principal = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigenvalues();
    principal.as_mut_slice().sort_by(f64::total_cmp);
    let [least, middle, most] = principal.into();
    let need = if least <= 0.0 {
        "a body has a positive inertia about every axis; check signs and products of inertia"
    } else if most > (least + middle) * (1.0 + ROUNDING) {
        "no inertia is larger than the other two together; check the units, and that the point is the centre of mass"
    } else {
        return Ok(());
    };
    let principal = format!("{elements:?} with principal inertias {least:.3e}, {middle:.3e}, {most:.3e}");
    Err(ScenarioError::bad(key, &principal, need))
}
