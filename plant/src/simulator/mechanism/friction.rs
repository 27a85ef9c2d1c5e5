//! Stiff forces on the axes, and the friction of axes, hinges and ball joints in a step.
//!
//! The force of a step depends on the unknown speed at the step's end. An [`Element`] has the force at constant speed,
//! and its damping. The damping resists the change of speed like a mass: linearly implicit Euler (Baraff and Witkin,
//! Large Steps in Cloth Simulation, SIGGRAPH 1998). The scheme is stable for every stiffness.
//!
//! The law of friction is [shared](masseter_model::dynamics::Friction). This module has the state of friction (the
//! bristles of axes at rest) and its integration. The loads are those of earlier steps.

use std::ops::AddAssign;

use masseter_model::dynamics::{
    Bodies, DynamicsConfig, Friction, FrictionConfig, FrictionModel, Loads, Motion,
};
use masseter_model::geometry::AXES;
use nalgebra::{Matrix6, Vector6};

/// Time in which friction follows the loads, s. Without this time, a self-locking guide shakes.
const LOAD_TIME_S: f64 = 1e-3;

/// Friction with its state.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Braking {
    law: Friction,
    config: FrictionConfig,
    masses_kg: Vector6<f64>,
    loads: Loads,
    /// Deflection of the bristles of each axis (LuGre; Canudas de Wit et al., IEEE Trans. Automatic Control 40, 1995), m. Their
    /// stiffness grows with the load as Coulomb friction does.
    bristles_m: [f64; AXES],
}

impl Braking {
    /// The friction of a mechanism without load.
    pub(super) fn new(config: &DynamicsConfig, bodies: &Bodies) -> Self {
        Self {
            law: Friction::new(config),
            config: config.friction,
            masses_kg: bodies.axis_mass_kg(),
            loads: Loads::default(),
            bristles_m: [0.0; AXES],
        }
    }

    /// Coulomb friction of the axes under the present loads, N.
    pub(super) fn coulomb_n(&self) -> [f64; AXES] {
        self.law.coulomb_n(&self.loads)
    }

    /// The force on an axis with this Coulomb friction in a step, at a speed (m/s). `factor` multiplies the usual
    /// friction.
    pub(super) fn on_axis(
        &self,
        axis: usize,
        coulomb_n: f64,
        speed_m_s: f64,
        factor: f64,
        step_s: f64,
    ) -> Element {
        let element = match self.config.model {
            FrictionModel::Smooth | FrictionModel::None => {
                let drag_n_s_per_m = self.law.drag_n_s_per_m(coulomb_n, speed_m_s);
                Element { force_n: -drag_n_s_per_m * speed_m_s, damping_n_s_per_m: drag_n_s_per_m }
            }
            FrictionModel::Lugre => self.bristled(axis, coulomb_n, speed_m_s, step_s),
        };
        Element { force_n: factor * element.force_n, damping_n_s_per_m: factor * element.damping_n_s_per_m }
    }

    /// F = σ₀ z + σ₁ ż + σ₂ v.
    fn bristled(&self, axis: usize, coulomb_n: f64, speed_m_s: f64, step_s: f64) -> Element {
        let stiffness_n_per_m = coulomb_n / self.config.bristle_deflection_m;
        let slip = self.law.slip(speed_m_s, step_s);
        let z_m = self.bristles_m[axis];
        let next_m = (z_m + step_s * speed_m_s) / slip;
        // The damping fades with speed, so that sliding bristles do not drive the axis.
        let fading = (-(speed_m_s / self.config.breakaway_speed_m_s).powi(2)).exp();
        let damping_n_s_per_m = self.config.bristle_damping_ratio
            * 2.0
            * (stiffness_n_per_m * self.masses_kg[axis]).sqrt()
            * fading;
        let viscous_n_s_per_m = self.law.viscous_n_s_per_m;
        Element {
            force_n: -stiffness_n_per_m * next_m
                - damping_n_s_per_m * (next_m - z_m) / step_s
                - viscous_n_s_per_m * speed_m_s,
            damping_n_s_per_m: (stiffness_n_per_m * step_s + damping_n_s_per_m) / slip + viscous_n_s_per_m,
        }
    }

    /// The damping of hinges and ball joints against the platform's twist: their friction is its product with the twist.
    pub(super) fn of_joints(&self, motion: &Motion) -> Matrix6<f64> {
        self.law.joint_damping(&self.loads, motion)
    }

    /// Takes the loads of a step, at whose end the axes have these speeds, m/s.
    pub(super) fn apply_loads(&mut self, loads: &Loads, speeds_m_s: &Vector6<f64>, step_s: f64) {
        self.loads = self.loads.towards(loads, step_s / (step_s + LOAD_TIME_S));
        if self.config.model != FrictionModel::Lugre {
            return;
        }
        for axis in 0..AXES {
            let slip = self.law.slip(speeds_m_s[axis], step_s);
            self.bristles_m[axis] = (self.bristles_m[axis] + step_s * speeds_m_s[axis]) / slip;
        }
    }
}

/// A force that is linear in the change of the axis' speed within a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Element {
    /// Force at constant speed, N.
    pub(super) force_n: f64,
    /// Force against a change of the speed, N per m/s.
    pub(super) damping_n_s_per_m: f64,
}

impl Element {
    /// The force at the end of a step in which the speed changes by that much, N.
    pub(super) fn after_n(&self, change_m_s: f64) -> f64 {
        self.force_n - self.damping_n_s_per_m * change_m_s
    }

    /// A spring with a damper that is stretched by `stretch_m` now, at a speed, for a step.
    pub(super) fn spring(spring: Spring, stretch_m: f64, speed_m_s: f64, step_s: f64) -> Self {
        let Spring { stiffness_n_per_m, damping_n_s_per_m } = spring;
        // At the end of the step the spring is stretched by the way of the step more.
        let damping_n_s_per_m = damping_n_s_per_m + stiffness_n_per_m * step_s;
        Self { force_n: -stiffness_n_per_m * stretch_m - damping_n_s_per_m * speed_m_s, damping_n_s_per_m }
    }
}

impl AddAssign for Element {
    fn add_assign(&mut self, other: Self) {
        self.force_n += other.force_n;
        self.damping_n_s_per_m += other.damping_n_s_per_m;
    }
}

/// A spring with a damper.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Spring {
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_n_s_per_m: f64,
}

/// Steel on steel: 0.1 mm at 1 kN, damped so that a mass of a kilogram does not bounce.
pub(super) const CONTACT: Spring = Spring { stiffness_n_per_m: 1e7, damping_n_s_per_m: 5e3 };
