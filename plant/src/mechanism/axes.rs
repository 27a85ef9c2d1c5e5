//! The axes between drives and platform: friction, end stops, play, and what faults make of them.
//!
//! Each part states its force in a step as an [`Element`]; their sums enter the equations of motion. The masses of the
//! axes are not part of this module, but for the drives' sides of loose joints.

use masseter_model::geometry::{AXES, LEGS, Mechanism};
use masseter_scenario::{AxesConfig, FaultKindConfig};
use nalgebra::Vector6;

use super::coupling::Coupling;
use super::element::{Element, Spring};
use super::friction::Braking;
use super::seizure::Seizure;
use super::stops::Stops;
use crate::injection::Acting;

/// The axes d₁ d₂ d₃ l₁ l₂ l₃.
#[derive(Debug, Clone)]
pub(super) struct Axes {
    axes: [Axis; AXES],
}

#[derive(Debug, Clone)]
struct Axis {
    acting: Acting,
    mass_kg: f64,
    play_m: f64,
    /// Behind the ends of the stroke.
    ends: Stops,
    /// A fault's.
    stops: Option<Stops>,
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
#[derive(Debug, Clone, Copy)]
pub(super) struct AxesForces {
    /// On the moving bodies while the speeds stay, those of the drives included, N.
    pub(super) force_n: Vector6<f64>,
    /// Mass of the drives' sides, which the axes do not move, kg.
    pub(super) parted_kg: Vector6<f64>,
    /// What the change of the axes' speeds acts against like a mass, kg.
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
                acting: Acting::default(),
                mass_kg: masses_kg[axis],
                play_m: if axis < LEGS { config.slide_play_m } else { config.leg_play_m },
                ends: Stops::between(ends_m, steel),
                stops: None,
                seizure: None,
                coupling: Coupling::Rigid { beyond_m: 0.0 },
                is_at_end: false,
                hit_m_s: None,
            }
        };
        let mut axes = Self { axes: std::array::from_fn(axis) };
        for (axis, position_m) in axes.axes.iter_mut().zip(positions_m) {
            axis.loosen_as_built(AxisMotion { position_m, speed_m_s: 0.0 });
        }
        axes
    }

    /// The faults that act on an axis, and which of them have struck.
    pub(super) fn acting(&self, axis: usize) -> &Acting {
        &self.axes[axis].acting
    }

    /// A fault of an axis begins.
    pub(super) fn begin_fault(&mut self, axis: usize, kind: FaultKindConfig, size: f64, motion: AxisMotion) {
        self.axes[axis].begin_fault(kind, size, motion);
    }

    /// A fault of an axis ends.
    pub(super) fn end_fault(&mut self, axis: usize, kind: FaultKindConfig, motion: AxisMotion) {
        self.axes[axis].end_fault(kind, motion);
    }

    /// The next axis that has run into an end of its own, with its speed, m/s.
    pub(super) fn take_stop_hit(&mut self) -> Option<(usize, f64)> {
        self.axes.iter_mut().enumerate().find_map(|(axis, faults)| Some((axis, faults.hit_m_s.take()?)))
    }

    /// Where the encoders see the axes: at the drives' side of each joint, m.
    pub(super) fn drive_positions_m(&self, joints_m: [f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| self.axes[axis].coupling.drive_m(joints_m[axis]))
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
        let mut forces = AxesForces {
            force_n: Vector6::zeros(),
            parted_kg: Vector6::zeros(),
            resisting_kg: Vector6::zeros(),
        };
        let coulomb_n = braking.coulomb_n();
        for (number, axis) in self.axes.iter_mut().enumerate() {
            let motion = AxisMotion { position_m: positions_m[number], speed_m_s: speeds_m_s[number] };
            let factor = axis.acting.size(FaultKindConfig::Friction).unwrap_or(1.0);
            let mut element = axis.act(drives_n[number], motion, step_s);
            element += braking.on_axis(number, coulomb_n[number], motion.speed_m_s, factor, step_s);
            forces.force_n[number] = element.force_n;
            forces.parted_kg[number] = axis.coupling.parted_kg();
            forces.resisting_kg[number] = element.damping_n_s_per_m * step_s;
        }
        forces
    }

    /// Solves the drives' sides for a step at whose end the axes have these speeds, m/s.
    pub(super) fn settle(&mut self, speeds_m_s: &Vector6<f64>) {
        for (axis, speed_m_s) in self.axes.iter_mut().zip(speeds_m_s) {
            axis.coupling.settle(*speed_m_s);
        }
    }

    /// Moves the drives' sides.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.axes.iter_mut().for_each(|axis| axis.coupling.advance(dt_s));
    }
}

impl Axis {
    fn begin_fault(&mut self, kind: FaultKindConfig, size: f64, motion: AxisMotion) {
        let AxisMotion { position_m, speed_m_s } = motion;
        self.acting.begin(kind, size);
        let strikes = match kind {
            FaultKindConfig::Jam => {
                self.seizure = Some(Seizure::at(position_m));
                true
            }
            FaultKindConfig::EndStop => {
                self.stops = Some(Stops::steel([position_m - size, position_m + size]));
                false
            }
            FaultKindConfig::Play => {
                self.coupling.loosen(size, self.mass_kg, position_m, speed_m_s);
                size > 0.0
            }
            FaultKindConfig::BrokenRod => {
                self.coupling.loosen(f64::INFINITY, self.mass_kg, position_m, speed_m_s);
                true
            }
            // Friction has no memory of its fault.
            _ => size.to_bits() != 1.0_f64.to_bits(),
        };
        if strikes {
            self.acting.strike(kind);
        }
    }

    fn end_fault(&mut self, kind: FaultKindConfig, motion: AxisMotion) {
        self.acting.end(kind);
        match kind {
            FaultKindConfig::Jam => self.seizure = None,
            FaultKindConfig::EndStop => self.stops = None,
            FaultKindConfig::Play | FaultKindConfig::BrokenRod => {
                self.coupling.tighten(motion.position_m);
                self.loosen_as_built(motion);
            }
            _ => {}
        }
    }

    /// Gives the joint the play that it has without faults.
    fn loosen_as_built(&mut self, AxisMotion { position_m, speed_m_s }: AxisMotion) {
        if self.play_m > 0.0 {
            self.coupling.loosen(self.play_m, self.mass_kg, position_m, speed_m_s);
        }
    }

    /// The force on the axis in a step, without friction.
    fn act(
        &mut self,
        drive_n: f64,
        AxisMotion { position_m, speed_m_s }: AxisMotion,
        step_s: f64,
    ) -> Element {
        let mut element = self.coupling.push(drive_n, position_m, speed_m_s, step_s);
        if let Some(seizure) = &mut self.seizure {
            element += seizure.hold(position_m, speed_m_s, step_s);
        }
        if let Some(contact) = self.stops.and_then(|stops| stops.touch(position_m, speed_m_s, step_s)) {
            self.acting.strike(FaultKindConfig::EndStop);
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
