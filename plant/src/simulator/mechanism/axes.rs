//! The axes between drives and platform: friction, end stops, play, and the effects of faults.
//!
//! Each part states its force in a step as an [`Element`]; their sums enter the equations of motion. The masses of the
//! axes are not part of this module, except for the drives' sides of loose joints.

use masseter_model::dynamics::AxesConfig;
use masseter_model::geometry::{AXES, LEGS, Mechanism};
use nalgebra::Vector6;

use super::coupling::Coupling;
use super::friction::{Braking, CONTACT, Element, Spring};
use super::stops::{Seizure, Stops};

/// The axes d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Axes {
    pub(crate) each: [Axis; AXES],
}

/// The effects of faults on an axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct AxisFaults {
    /// Whether its guide has seized.
    pub(crate) is_jammed: bool,
    /// The factor on its friction.
    pub(crate) friction: f64,
    /// The play of its joint in place of the built-in play, m; infinite for a broken rod.
    pub(crate) play_m: Option<f64>,
    /// Between the hard stops in its way, m.
    pub(crate) free_m: [f64; 2],
}

impl AxisFaults {
    /// An axis without faults.
    pub(crate) const NONE: Self =
        Self { is_jammed: false, friction: 1.0, play_m: None, free_m: [f64::NEG_INFINITY, f64::INFINITY] };
}

/// One axis.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Axis {
    pub(crate) faults: AxisFaults,
    /// The touched hard stops of faults since their last change: the lower, the upper.
    pub(crate) touched: [bool; 2],
    mass_kg: f64,
    play_m: f64,
    /// Behind the ends of the stroke.
    ends: Stops,
    seizure: Option<Seizure>,
    coupling: Coupling,
    is_at_end: bool,
    hit_m_s: Option<f64>,
}

/// The motion of an axis at the beginning of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisMotion {
    pub(super) position_m: f64,
    pub(super) speed_m_s: f64,
}

/// The forces of the axes in a step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct AxesForces {
    /// Forces on the moving bodies at constant speeds, with those of the drives, N.
    pub(super) force_n: Vector6<f64>,
    /// The parts of these that the drives and friction have.
    pub(super) driven: [Element; AXES],
    pub(super) braked: [Element; AXES],
    /// Mass of the drives' sides, which the axes do not move, kg.
    pub(super) parted_kg: Vector6<f64>,
    /// Resistance to a change of the axes' speeds, like a mass, kg.
    pub(super) resisting_kg: Vector6<f64>,
}

impl Axes {
    /// The axes of a mechanism at rest in these positions (m), with their masses.
    pub(super) fn new(
        config: &AxesConfig,
        mechanism: &Mechanism,
        positions_m: [f64; AXES],
        masses_kg: &Vector6<f64>,
    ) -> Self {
        let steel = Spring {
            stiffness_n_per_m: config.stop_stiffness_n_per_m,
            damping_n_s_per_m: config.stop_damping_n_s_per_m,
        };
        let axis = |axis: usize| {
            let [low_m, high_m] = mechanism.strokes().of_axis(axis);
            let ends_m = [low_m - config.stop_beyond_m, high_m + config.stop_beyond_m];
            Axis {
                faults: AxisFaults::NONE,
                touched: [false; 2],
                mass_kg: masses_kg[axis],
                play_m: if axis < LEGS { config.slide_play_m } else { config.leg_play_m },
                ends: Stops::between(ends_m, steel),
                seizure: None,
                coupling: Coupling::Rigid { beyond_m: 0.0 },
                is_at_end: false,
                hit_m_s: None,
            }
        };
        let mut axes = Self { each: std::array::from_fn(axis) };
        for (axis, position_m) in axes.each.iter_mut().zip(positions_m) {
            axis.loosen_as_built(AxisMotion { position_m, speed_m_s: 0.0 });
        }
        axes
    }

    /// The next axis that has run into an end of its own, with its speed, m/s.
    pub(crate) fn take_stop_hit(&mut self) -> Option<(usize, f64)> {
        self.each.iter_mut().enumerate().find_map(|(axis, faults)| Some((axis, faults.hit_m_s.take()?)))
    }

    /// Positions at the encoders: the drives' side of each joint, m.
    pub(super) fn drive_positions_m(&self, joints_m: [f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| self.each[axis].coupling.drive_m(joints_m[axis]))
    }

    /// The axes' forces in a step, with those of the drives (N).
    pub(super) fn act(
        &mut self,
        drives_n: &[f64; AXES],
        positions_m: [f64; AXES],
        speeds_m_s: &Vector6<f64>,
        braking: &Braking,
        step_s: f64,
    ) -> AxesForces {
        let mut forces = AxesForces::default();
        let coulomb_n = braking.coulomb_n();
        for (number, axis) in self.each.iter_mut().enumerate() {
            let motion = AxisMotion { position_m: positions_m[number], speed_m_s: speeds_m_s[number] };
            let driven = axis.coupling.push(drives_n[number], motion.position_m, motion.speed_m_s, step_s);
            let braked =
                braking.on_axis(number, coulomb_n[number], motion.speed_m_s, axis.faults.friction, step_s);
            let mut element = axis.act(driven, motion, step_s);
            element += braked;
            (forces.driven[number], forces.braked[number]) = (driven, braked);
            forces.force_n[number] = element.force_n;
            forces.parted_kg[number] = axis.coupling.parted_kg();
            forces.resisting_kg[number] = element.damping_n_s_per_m * step_s;
        }
        forces
    }

    /// Mass of the drives' sides, which the axes do not move, kg.
    pub(super) fn parted_kg(&self) -> Vector6<f64> {
        Vector6::from_fn(|axis, _| self.each[axis].coupling.parted_kg())
    }

    /// Solves the drives' sides for a step at whose end the axes have these speeds, m/s.
    pub(super) fn solve_drive_sides(&mut self, speeds_m_s: &Vector6<f64>) {
        for (axis, speed_m_s) in self.each.iter_mut().zip(speeds_m_s) {
            axis.coupling.solve_drive_side(*speed_m_s);
        }
    }

    /// Moves the drives' sides.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.each.iter_mut().for_each(|axis| axis.coupling.advance(dt_s));
    }
}

impl Axis {
    /// Sets the effects of faults on an axis from now on.
    pub(super) fn set_faults(&mut self, faults: AxisFaults, motion: AxisMotion) {
        let AxisMotion { position_m, speed_m_s } = motion;
        let before = std::mem::replace(&mut self.faults, faults);
        self.touched = [false; 2];
        self.seizure = faults.is_jammed.then(|| self.seizure.unwrap_or(Seizure { held_at_m: position_m }));
        match faults.play_m {
            _ if faults.play_m == before.play_m => {}
            Some(play_m) => self.coupling.loosen(play_m, self.mass_kg, position_m, speed_m_s),
            None => {
                self.coupling.tighten(position_m);
                self.loosen_as_built(motion);
            }
        }
    }

    /// Gives the joint its play without faults.
    fn loosen_as_built(&mut self, AxisMotion { position_m, speed_m_s }: AxisMotion) {
        if self.play_m > 0.0 {
            self.coupling.loosen(self.play_m, self.mass_kg, position_m, speed_m_s);
        }
    }

    /// The force on the axis in a step, with that of its drive and without friction.
    fn act(
        &mut self,
        mut element: Element,
        AxisMotion { position_m, speed_m_s }: AxisMotion,
        step_s: f64,
    ) -> Element {
        if let Some(seizure) = &mut self.seizure {
            element += seizure.hold(position_m, speed_m_s, step_s);
        }
        if let Some(contact) =
            Stops::between(self.faults.free_m, CONTACT).touch(position_m, speed_m_s, step_s)
        {
            self.touched[usize::from(contact.force_n < 0.0)] = true;
            element += contact;
        }
        let contact = self.ends.touch(position_m, speed_m_s, step_s);
        if contact.is_some() && !self.is_at_end {
            self.hit_m_s = Some(speed_m_s);
        }
        self.is_at_end = contact.is_some();
        element += contact.unwrap_or_default();
        element
    }
}
