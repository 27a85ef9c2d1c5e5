//! A stiff force on an axis, integrated without limit of its stiffness.
//!
//! The force of a step depends on the speed at the step's end, which is not known yet. An element states the force as if
//! the speed stayed, and its damping. The change of speed then acts against the damping like a mass: linearly implicit
//! Euler (Baraff and Witkin, Large Steps in Cloth Simulation, SIGGRAPH 1998). No stiffness makes it grow.

use std::ops::AddAssign;

/// A force that is linear in the change of the axis' speed within a step.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Element {
    /// Force while the speed stays as it is, N.
    pub(super) force_n: f64,
    /// Force against a change of the speed, N per m/s.
    pub(super) damping_n_s_per_m: f64,
}

impl Element {
    /// A spring with a damper that is stretched by `stretch_m` now, at a speed, for a step.
    pub(super) fn spring(
        Spring { stiffness_n_per_m, damping_n_s_per_m }: Spring,
        stretch_m: f64,
        speed_m_s: f64,
        step_s: f64,
    ) -> Self {
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
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Spring {
    pub(super) stiffness_n_per_m: f64,
    pub(super) damping_n_s_per_m: f64,
}

/// Steel on steel: 0.1 mm at 1 kN, damped so that a mass of a kilogram does not bounce.
pub(super) const CONTACT: Spring = Spring { stiffness_n_per_m: 1e7, damping_n_s_per_m: 5e3 };
