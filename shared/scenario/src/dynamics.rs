//! The emulated mechanism's masses and friction: `[dynamics]`.

use masseter_model::dynamics::DynamicsConfig;
use nalgebra::Matrix3;

use super::error::ScenarioError;
use super::need::{keyed, require_positive, require_within};
use super::{axes, friction};

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

pub(super) fn validate(dynamics: &DynamicsConfig) -> Result<(), ScenarioError> {
    let masses = keyed!("dynamics", dynamics, carriage_mass_kg cylinder_mass_kg rod_mass_kg platform_mass_kg);
    require_within(&masses.map(|(key, kg)| (key, kg, LEAST_KG, MOST_KG)))?;
    let inertias = keyed!("dynamics", dynamics, cylinder_inertia_kg_m2 rod_inertia_kg_m2);
    require_within(&inertias.map(|(key, kg_m2)| (key, kg_m2, 0.0, MOST_KG_M2)))?;
    let centres = keyed!("dynamics", dynamics, cylinder_centre_m rod_centre_m);
    let centre_m = dynamics.platform_centre_m.map(|m| ("dynamics.platform_centre_m", m));
    for near in [&centres[..], &centre_m] {
        near.iter().try_for_each(|&(key, m)| require_within(&[(key, m, -FURTHEST_M, FURTHEST_M)]))?;
    }
    require_inertia("dynamics.platform_inertia_kg_m2", dynamics.platform_inertia_kg_m2)?;
    require_within(&[("dynamics.gravity_m_s2", dynamics.gravity_m_s2, 0.0, MOST_GRAVITY_M_S2)])?;
    let offset_m = dynamics.initial_offset_m;
    require_within(&offset_m.map(|m| ("dynamics.initial_offset_m", m, -FURTHEST_M, FURTHEST_M)))?;
    require_positive(&keyed!("dynamics", dynamics, initial_leg_m))?;
    require_within(&[
        ("dynamics.slide_friction_n", dynamics.slide_friction_n, 0.0, MOST_FRICTION_N),
        (
            "dynamics.viscous_friction_n_s_per_m",
            dynamics.viscous_friction_n_s_per_m,
            0.0,
            MOST_VISCOUS_N_S_PER_M,
        ),
    ])?;
    axes::validate(&dynamics.axes)?;
    friction::validate(&dynamics.friction)?;
    if !DynamicsConfig::STEPS_NS.contains(&dynamics.step_ns) {
        return Err(ScenarioError::bad("dynamics.step_ns", &dynamics.step_ns, "use 10000 to 250000 ns"));
    }
    Ok(())
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
