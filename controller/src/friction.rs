//! Friction of the axes as the controller believes in it: Coulomb friction, which fades towards zero at rest, and viscous
//! friction.

use masseter_shared::config::DynamicsConfig;
use masseter_shared::geometry::LEGS;
use nalgebra::Vector6;

/// Below about this speed Coulomb friction fades towards zero, m/s.
const STICTION_SPEED_M_S: f64 = 1e-3;
/// Coulomb friction of a leg as a share of a slide's.
const LEG_SHARE: f64 = 0.25;

/// Friction of the axes d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Friction {
    /// The largest friction of an axis at rest, N.
    pub(crate) coulomb_n: Vector6<f64>,
    viscous_n_s_per_m: f64,
}

impl Friction {
    pub(crate) fn new(config: &DynamicsConfig) -> Self {
        let share = |axis: usize| if axis < LEGS { 1.0 } else { LEG_SHARE };
        Self {
            coulomb_n: Vector6::from_fn(|axis, _| config.slide_friction_n * share(axis)),
            viscous_n_s_per_m: config.viscous_friction_n_s_per_m,
        }
    }

    /// The force that overcomes friction at these speeds (m/s), N.
    pub(crate) fn force_n(&self, speeds_m_s: &Vector6<f64>) -> Vector6<f64> {
        self.coulomb_n.zip_map(speeds_m_s, |coulomb_n, speed| {
            coulomb_n * speed / speed.hypot(STICTION_SPEED_M_S) + self.viscous_n_s_per_m * speed
        })
    }
}
