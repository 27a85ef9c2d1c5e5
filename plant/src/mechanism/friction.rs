//! Friction of the axes: Coulomb friction, which fades towards zero at rest, and viscous friction. There is no stiction.

use masseter_shared::config::DynamicsConfig;
use masseter_shared::geometry::LEGS;
use nalgebra::Vector6;

use super::element::Element;

/// Below about this speed Coulomb friction fades towards zero, m/s.
const STICTION_SPEED_M_S: f64 = 1e-3;
/// Coulomb friction of a leg as a share of a slide's.
const LEG_SHARE: f64 = 0.25;

/// Coulomb friction of the axes d₁ d₂ d₃ l₁ l₂ l₃.
fn coulomb_n(config: &DynamicsConfig) -> Vector6<f64> {
    let share = |axis: usize| if axis < LEGS { 1.0 } else { LEG_SHARE };
    Vector6::from_fn(|axis, _| config.slide_friction_n * share(axis))
}

/// Force against a motion of the axes at these speeds (m/s), N.
pub(super) fn force_n(config: &DynamicsConfig, speeds_m_s: &Vector6<f64>) -> Vector6<f64> {
    coulomb_n(config).zip_map(speeds_m_s, |coulomb_n, speed| {
        coulomb_n * speed / speed.hypot(STICTION_SPEED_M_S) + config.viscous_friction_n_s_per_m * speed
    })
}

/// The change of an axis' force where its friction is a multiple of what it was, at a speed (m/s). More friction acts on the
/// speed at the end of a step, so that no factor turns a motion back.
pub(super) fn change(config: &DynamicsConfig, axis: usize, factor: f64, speed_m_s: f64) -> Element {
    let slope_n_s_per_m =
        coulomb_n(config)[axis] / speed_m_s.hypot(STICTION_SPEED_M_S) + config.viscous_friction_n_s_per_m;
    let damping_n_s_per_m = (factor - 1.0) * slope_n_s_per_m;
    Element { force_n: -damping_n_s_per_m * speed_m_s, damping_n_s_per_m: damping_n_s_per_m.max(0.0) }
}

/// The steepest slope of the force over speed, which is that at rest, N per m/s.
pub(super) fn damping_n_s_per_m(config: &DynamicsConfig) -> Vector6<f64> {
    coulomb_n(config).map(|coulomb_n| coulomb_n / STICTION_SPEED_M_S + config.viscous_friction_n_s_per_m)
}
