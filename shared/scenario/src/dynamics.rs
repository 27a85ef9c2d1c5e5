//! The emulated mechanism's masses, friction, end stops and play: `[dynamics]`, `[dynamics.friction]`, `[dynamics.axes]`.

use masseter_model::dynamics::{DynamicsConfig, FrictionConfig, FrictionModel};
use nalgebra::Matrix3;

use super::error::{Checked, ranges_of, require};

/// Allowance for rounding: share by which a flat body's largest inertia may exceed the sum of the others.
const ROUNDING: f64 = 1e-6;
/// Least efficiency of a screw: below it the screw hides too much of a load that drives it.
const LEAST_SHOWN: f64 = 0.7;

/// Checks the values of this table: `dynamics` or `controller.model`.
pub(super) fn validate(table: &str, dynamics: &DynamicsConfig) -> Checked {
    dynamics.check_ranges(ranges_of(table))?;
    dynamics.axes.check_ranges(ranges_of(&format!("{table}.axes")))?;
    dynamics.friction.check_ranges(ranges_of(&format!("{table}.friction")))?;
    require_inertia("platform_inertia_kg_m2", dynamics.platform_inertia_kg_m2)
        .map_err(|refusal| refusal.in_table(table))
}

/// Refuses screws that hide the load from the forces of the drives.
pub(super) fn require_open_screws(friction: &FrictionConfig) -> Checked {
    let need = "use at least 0.7 with [force_estimate] or [force_control], or control by a load cell: this screw hides the load from \
                its drive";
    let screws = [
        ("dynamics.friction.slide_screw_efficiency", friction.slide_screw_efficiency),
        ("dynamics.friction.leg_screw_efficiency", friction.leg_screw_efficiency),
    ];
    screws.into_iter().try_for_each(|(key, efficiency)| {
        let is_hiding = friction.model != FrictionModel::None && efficiency < LEAST_SHOWN;
        require(!is_hiding, key, &efficiency, need)
    })
}

/// Refuses a tensor that no body has: not positive definite, or with a principal inertia larger than the two others
/// together.
fn require_inertia(key: &str, elements: [f64; 6]) -> Checked {
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
