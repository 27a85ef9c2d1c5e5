//! The emulated mechanism's masses, friction, end stops and play: `[dynamics]`, `[dynamics.friction]`, `[dynamics.axes]`.

use masseter_model::dynamics::{AxesConfig, DynamicsConfig, FrictionConfig, FrictionModel};
use nalgebra::Matrix3;

use super::error::{Checked, bounded, keyed, require, require_positive, require_within};

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
/// A screw of less efficiency hides too much of a load that drives it.
const LEAST_SHOWN: f64 = 0.7;

pub(super) fn validate(dynamics: &DynamicsConfig) -> Checked {
    require_within(&bounded!("dynamics", dynamics,
        carriage_mass_kg [LEAST_KG, MOST_KG] cylinder_mass_kg [LEAST_KG, MOST_KG]
        rod_mass_kg [LEAST_KG, MOST_KG] platform_mass_kg [LEAST_KG, MOST_KG]
        cylinder_inertia_kg_m2 [0.0, MOST_KG_M2] rod_inertia_kg_m2 [0.0, MOST_KG_M2]
        cylinder_centre_m [-FURTHEST_M, FURTHEST_M] rod_centre_m [-FURTHEST_M, FURTHEST_M]
    ))?;
    let near = |key, place_m: [f64; 3]| require_within(&place_m.map(|m| (key, m, -FURTHEST_M, FURTHEST_M)));
    near("dynamics.platform_centre_m", dynamics.platform_centre_m)?;
    require_inertia("dynamics.platform_inertia_kg_m2", dynamics.platform_inertia_kg_m2)?;
    require_within(&bounded!("dynamics", dynamics, gravity_m_s2 [0.0, MOST_GRAVITY_M_S2]))?;
    near("dynamics.initial_offset_m", dynamics.initial_offset_m)?;
    require_positive(&keyed!("dynamics", dynamics, initial_leg_m))?;
    require_within(&bounded!("dynamics", dynamics,
        slide_friction_n [0.0, MOST_FRICTION_N] viscous_friction_n_s_per_m [0.0, MOST_VISCOUS_N_S_PER_M]
    ))?;
    validate_axes(&dynamics.axes)?;
    validate_friction(&dynamics.friction)?;
    let is_step = DynamicsConfig::STEPS_NS.contains(&dynamics.step_ns);
    require(is_step, "dynamics.step_ns", &dynamics.step_ns, "use 10000 to 250000 ns")
}

fn validate_axes(axes: &AxesConfig) -> Checked {
    require_within(&bounded!("dynamics.axes", axes,
        stop_beyond_m [0.0, 0.1] stop_stiffness_n_per_m [1e3, 1e9] stop_damping_n_s_per_m [0.0, 1e6]
        slide_play_m [0.0, 0.02] leg_play_m [0.0, 0.02]
    ))
}

fn validate_friction(friction: &FrictionConfig) -> Checked {
    require_within(&bounded!("dynamics.friction", friction,
        guide_coefficient [0.0, 1.0] block_spacing_m [0.005, 1.0] block_factor [0.0, 10.0]
        breakaway_ratio [1.0, 3.0] breakaway_speed_m_s [1e-4, 0.1]
        slide_screw_efficiency [0.1, 1.0] leg_screw_efficiency [0.1, 1.0]
        joint_coefficient [0.0, 1.0] hinge_radius_m [0.0, 0.05] ball_radius_m [0.0, 0.05]
        bristle_deflection_m [1e-7, 1e-3] bristle_damping_ratio [0.0, 10.0]
    ))
}

/// Refuses screws through which the forces of the drives do not show the load.
pub(super) fn require_open_screws(friction: &FrictionConfig) -> Checked {
    let need = "use at least 0.7 with [force_estimate] or [force_control], or control by a load cell: this screw hides the load from \
                its drive";
    let screws = keyed!("dynamics.friction", friction, slide_screw_efficiency leg_screw_efficiency);
    screws.into_iter().try_for_each(|(key, efficiency)| {
        let is_hiding = friction.model != FrictionModel::None && efficiency < LEAST_SHOWN;
        require(!is_hiding, key, &efficiency, need)
    })
}

/// Refuses a tensor that no body has: one that is not positive definite, or a principal inertia larger than the two others
/// together.
fn require_inertia(key: &'static str, elements: [f64; 6]) -> Checked {
    require_within(&elements.map(|kg_m2| (key, kg_m2, -MOST_KG_M2, MOST_KG_M2)))?;
    let [xx, yy, zz, xy, xz, yz] = elements;
    let mut principal = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigenvalues();
    principal.as_mut_slice().sort_by(f64::total_cmp);
    let [least, middle, most] = principal.into();
    let principal = format!("{elements:?} with principal inertias {least:.3e}, {middle:.3e}, {most:.3e}");
    let need = "a body has a positive inertia about every axis; check signs and products of inertia";
    require(least > 0.0, key, &principal, need)?;
    let need = "no inertia is larger than the other two together; check the units, and that the point is the centre of mass";
    require(most <= (least + middle) * (1.0 + ROUNDING), key, &principal, need)
}
