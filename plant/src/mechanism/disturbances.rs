//! The mechanism's faults: what is wrong with each axis at an instant, and what that adds to the equations of motion.
//!
//! A mechanism with faults has hard stops a little beyond its strokes: a fault may take an axis to their ends, where the
//! controller never takes it.

use masseter_shared::config::{DynamicsConfig, FaultKindConfig};
use masseter_shared::geometry::AXES;
use nalgebra::Vector6;

use super::coupling::Coupling;
use super::element::Element;
use super::friction;
use super::seizure::Seizure;
use super::stops::Stops;
use crate::injection::Acting;

/// Distance from the end of a stroke to the mechanism's own stop, m.
const BEYOND_STROKE_M: f64 = 0.002;

/// What is wrong with an axis.
#[derive(Debug, Clone)]
struct AxisFaults {
    acting: Acting,
    /// At the ends of the stroke.
    ends: Stops,
    seizure: Option<Seizure>,
    stops: Option<Stops>,
    coupling: Coupling,
}

/// What is wrong with the axes.
#[derive(Debug, Clone)]
pub(super) struct Disturbances {
    axes: [AxisFaults; AXES],
}

/// An axis in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct AxisMotion {
    pub(super) position_m: f64,
    pub(super) speed_m_s: f64,
    pub(super) mass_kg: f64,
}

/// What disturbances make of the equations of motion in a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Disturbed {
    /// The axes' forces, those of the drives included, N.
    pub(super) force_n: Vector6<f64>,
    /// Mass of the drives' sides, which the axes do not move, kg.
    pub(super) parted_kg: Vector6<f64>,
    /// What the change of the axes' speeds acts against like a mass, kg.
    pub(super) resisting_kg: Vector6<f64>,
}

impl Disturbances {
    /// Nothing is wrong with axes of these strokes, m.
    pub(super) fn new(strokes_m: [[f64; 2]; AXES]) -> Self {
        let axis = |[low_m, high_m]: [f64; 2]| AxisFaults {
            acting: Acting::default(),
            ends: Stops::between([low_m - BEYOND_STROKE_M, high_m + BEYOND_STROKE_M]),
            seizure: None,
            stops: None,
            coupling: Coupling::Rigid { beyond_m: 0.0 },
        };
        Self { axes: strokes_m.map(axis) }
    }

    /// The faults that act on an axis, and which of them have struck.
    pub(super) fn acting(&self, axis: usize) -> &Acting {
        &self.axes[axis].acting
    }

    /// A fault of an axis begins.
    pub(super) fn begin(&mut self, axis: usize, kind: FaultKindConfig, size: f64, motion: AxisMotion) {
        self.axes[axis].begin(kind, size, motion);
    }

    /// A fault of an axis ends.
    pub(super) fn end(&mut self, axis: usize, kind: FaultKindConfig, position_m: f64) {
        self.axes[axis].end(kind, position_m);
    }

    /// Where the encoders see the axes: at the drives' side of each joint, m.
    pub(super) fn drive_positions_m(&self, joints_m: [f64; AXES]) -> [f64; AXES] {
        std::array::from_fn(|axis| self.axes[axis].coupling.drive_m(joints_m[axis]))
    }

    /// The axes' forces in a step, with those of the drives (N).
    pub(super) fn act(
        &mut self,
        config: &DynamicsConfig,
        drives_n: &[f64; AXES],
        motions: [AxisMotion; AXES],
    ) -> Disturbed {
        let step_s = config.step_ns as f64 * 1e-9;
        let mut disturbed = Disturbed {
            force_n: Vector6::zeros(),
            parted_kg: Vector6::zeros(),
            resisting_kg: Vector6::zeros(),
        };
        for (axis, (faults, motion)) in self.axes.iter_mut().zip(motions).enumerate() {
            let mut element =
                faults.coupling.push(drives_n[axis], motion.position_m, motion.speed_m_s, step_s);
            element += faults.resist(motion, step_s);
            if let Some(factor) = faults.acting.size(FaultKindConfig::Friction) {
                element += friction::change(config, axis, factor, motion.speed_m_s);
            }
            disturbed.force_n[axis] = element.force_n;
            disturbed.parted_kg[axis] = faults.coupling.parted_kg();
            disturbed.resisting_kg[axis] = element.damping_n_s_per_m * step_s;
        }
        disturbed
    }

    /// Solves the drives' sides for a step at whose end the axes have these speeds, m/s.
    pub(super) fn settle(&mut self, speeds_m_s: &Vector6<f64>) {
        for (faults, speed_m_s) in self.axes.iter_mut().zip(speeds_m_s) {
            faults.coupling.settle(*speed_m_s);
        }
    }

    /// Moves the drives' sides.
    pub(super) fn advance(&mut self, dt_s: f64) {
        self.axes.iter_mut().for_each(|faults| faults.coupling.advance(dt_s));
    }
}

impl AxisFaults {
    fn begin(&mut self, kind: FaultKindConfig, size: f64, motion: AxisMotion) {
        let AxisMotion { position_m, speed_m_s, mass_kg } = motion;
        self.acting.begin(kind, size);
        let strikes = match kind {
            FaultKindConfig::Jam => {
                self.seizure = Some(Seizure::at(position_m));
                true
            }
            FaultKindConfig::EndStop => {
                self.stops = Some(Stops::between([position_m - size, position_m + size]));
                false
            }
            FaultKindConfig::Play => {
                self.coupling.loosen(size, mass_kg, position_m, speed_m_s);
                size > 0.0
            }
            FaultKindConfig::BrokenRod => {
                self.coupling.loosen(f64::INFINITY, mass_kg, position_m, speed_m_s);
                true
            }
            // Friction has no memory.
            _ => size.to_bits() != 1.0_f64.to_bits(),
        };
        if strikes {
            self.acting.strike(kind);
        }
    }

    fn end(&mut self, kind: FaultKindConfig, position_m: f64) {
        self.acting.end(kind);
        match kind {
            FaultKindConfig::Jam => self.seizure = None,
            FaultKindConfig::EndStop => self.stops = None,
            FaultKindConfig::Play | FaultKindConfig::BrokenRod => self.coupling.tighten(position_m),
            _ => {}
        }
    }

    /// The forces of what holds or stops the axis.
    fn resist(&mut self, AxisMotion { position_m, speed_m_s, .. }: AxisMotion, step_s: f64) -> Element {
        let mut resistance = Element::default();
        if let Some(seizure) = &mut self.seizure {
            resistance += seizure.hold(position_m, speed_m_s, step_s);
        }
        if let Some(contact) = self.stops.and_then(|stops| stops.touch(position_m, speed_m_s, step_s)) {
            self.acting.strike(FaultKindConfig::EndStop);
            resistance += contact;
        }
        if let Some(contact) = self.ends.touch(position_m, speed_m_s, step_s) {
            resistance += contact;
        }
        resistance
    }
}
