//! The ledger of energy: the work of every kind of force on the bodies of the mechanism since the start.
//!
//! Forces hold for a step, in which the twist changes evenly: a power is a linear function of time. The bodies' own energy
//! is no part of the ledger. So energy without work, or work without energy, shows an error of the simulation.

use masseter_model::dynamics::Motion;
use masseter_model::geometry::{AXES, LEGS, Twist};
use masseter_runtime::messages::WORKS;
use nalgebra::Vector6;

use super::axes::AxesForces;

/// The kinds of forces, in the order of the message.
#[derive(Debug, Clone, Copy)]
enum Kind {
    /// Drives, at the axes' side of their joints.
    Motors = 0,
    /// Friction of the slides' axes.
    Slides = 1,
    /// Friction of the legs' axes.
    Legs = 2,
    /// Friction of hinges and balls.
    Joints = 3,
    /// Teeth and food.
    Contact = 4,
    /// Pushes, payload, end stops, seized guides.
    Others = 5,
}

/// The ledger.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Ledger {
    /// Work by the kind of force, J.
    pub(crate) work_j: [f64; WORKS],
    /// Power at the beginning of the step, W, and its growth, W/s.
    power_w: [f64; WORKS],
    growth_w_s: [f64; WORKS],
    /// How far the step has come, s.
    elapsed_s: f64,
}

/// The forces of a step on the bodies.
pub(super) struct StepForces<'a> {
    pub(super) axes: &'a AxesForces,
    /// Speeds of the axes at the beginning.
    pub(super) speeds_m_s: Vector6<f64>,
    /// Wrenches on the platform (N, N m): hinges and balls, teeth and food, pushes and payload.
    pub(super) joints: Vector6<f64>,
    pub(super) contact: Vector6<f64>,
    pub(super) others: Vector6<f64>,
}

impl Ledger {
    /// Begins a step of that length with its forces and its acceleration, at the twist of its beginning.
    pub(super) fn begin(
        &mut self,
        forces: &StepForces,
        motion: &Motion,
        twist: &Twist,
        acceleration: &Twist,
        step_s: f64,
    ) {
        let (speeds_m_s, gains_m_s2) = (&forces.speeds_m_s, motion.jacobian.actuators * acceleration);
        (self.power_w, self.growth_w_s, self.elapsed_s) = ([0.0; WORKS], [0.0; WORKS], 0.0);
        let AxesForces { force_n, driven, braked, resisting_kg, .. } = forces.axes;
        for axis in 0..AXES {
            let change_m_s = gains_m_s2[axis] * step_s;
            let [driven_n, braked_n] =
                [driven[axis], braked[axis]].map(|element| element.after_n(change_m_s));
            let others_n = force_n[axis] - resisting_kg[axis] * gains_m_s2[axis] - driven_n - braked_n;
            let friction = if axis < LEGS { Kind::Slides } else { Kind::Legs };
            for (kind, force_n) in [(Kind::Motors, driven_n), (friction, braked_n), (Kind::Others, others_n)]
            {
                self.power_w[kind as usize] += force_n * speeds_m_s[axis];
                self.growth_w_s[kind as usize] += force_n * gains_m_s2[axis];
            }
        }
        for (kind, wrench) in
            [(Kind::Joints, forces.joints), (Kind::Contact, forces.contact), (Kind::Others, forces.others)]
        {
            self.power_w[kind as usize] += wrench.dot(twist);
            self.growth_w_s[kind as usize] += wrench.dot(acceleration);
        }
    }

    /// Counts the work of a part of the step.
    pub(super) fn advance(&mut self, dt_s: f64) {
        let middle_s = self.elapsed_s + dt_s / 2.0;
        for ((work_j, power_w), growth_w_s) in self.work_j.iter_mut().zip(self.power_w).zip(self.growth_w_s) {
            *work_j += (power_w + growth_w_s * middle_s) * dt_s;
        }
        self.elapsed_s += dt_s;
    }
}
