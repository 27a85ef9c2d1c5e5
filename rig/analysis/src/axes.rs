//! The demands on each axis while the motion played, and how the drive met them.

use masseter_shared::config::Scenario;
use masseter_shared::geometry::{AXES, Mechanism};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Reading, State};

use crate::by_cycle::ByCycle;
use crate::pose_errors::pose;

/// The largest magnitudes of an axis.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AxisFigures {
    /// Velocity of the desired motion, m/s.
    pub velocity_m_s: f64,
    /// Acceleration of the desired motion, m/s².
    pub acceleration_m_s2: f64,
    /// Distance of the position from the target that should be reached, m.
    pub following_error_m: f64,
    /// Force of the drive, N.
    pub force_n: f64,
}

/// Collects them.
#[derive(Debug)]
pub(super) struct AxisWatch {
    mechanism: Option<Mechanism>,
    period_s: f64,
    /// From a command to the reading of the position that its targets lead to.
    lead_cycles: u64,
    /// Desired positions and velocities of the last state, with its cycle.
    last: Option<(u64, [f64; AXES], Option<[f64; AXES]>)>,
    targets_m: ByCycle<[f64; AXES]>,
    /// Positions and forces.
    found: ByCycle<([f64; AXES], [f64; AXES])>,
    figures: [AxisFigures; AXES],
}

impl AxisWatch {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            mechanism: Mechanism::new(&scenario.mechanism).ok(),
            period_s: scenario.period_s(),
            lead_cycles: scenario.controller.lead_cycles.round() as u64,
            last: None,
            targets_m: ByCycle::default(),
            found: ByCycle::default(),
            figures: Default::default(),
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        if command.controller_state == ControllerState::Running.code() {
            self.targets_m.insert(command.cycle, command.target_m);
            self.compare(command.cycle);
        }
    }

    pub(super) fn reading(&mut self, reading: &Reading) {
        self.found.insert(reading.cycle, (reading.position_m, reading.force_n));
        self.compare(reading.cycle.saturating_sub(self.lead_cycles));
    }

    /// Velocity and acceleration are those of the desired poses, which have no noise.
    pub(super) fn state(&mut self, state: &State) {
        let last = self.last.take();
        if state.controller_state != ControllerState::Running.code() {
            return;
        }
        let desired = pose(state.desired_position_m, state.desired_quaternion_wxyz);
        let joints = self.mechanism.as_ref().zip(desired).and_then(|(rig, pose)| rig.inverse(&pose).ok());
        let Some(axes_m) = joints.map(|joints| joints.actuators.to_axes()) else { return };
        let rates = |before: [f64; AXES], now: [f64; AXES]| {
            std::array::from_fn(|axis| (now[axis] - before[axis]) / self.period_s)
        };
        let last = last.filter(|(cycle, ..)| *cycle + 1 == state.cycle);
        let velocity_m_s = last.map(|(_, before_m, _)| rates(before_m, axes_m));
        let before_m_s = last.and_then(|(_, _, before_m_s)| before_m_s);
        let acceleration_m_s2 = before_m_s.zip(velocity_m_s).map(|(before, now)| rates(before, now));
        self.keep(velocity_m_s, |figures| &mut figures.velocity_m_s);
        self.keep(acceleration_m_s2, |figures| &mut figures.acceleration_m_s2);
        self.last = Some((state.cycle, axes_m, velocity_m_s));
    }

    /// Compares the targets of a cycle with the positions that they led to, once both are known.
    fn compare(&mut self, cycle: u64) {
        let pair = self.targets_m.get(cycle).zip(self.found.get(cycle + self.lead_cycles));
        let Some((targets_m, (positions_m, forces_n))) = pair else { return };
        let errors_m = std::array::from_fn(|axis| targets_m[axis] - positions_m[axis]);
        self.keep(Some(errors_m), |figures| &mut figures.following_error_m);
        self.keep(Some(forces_n), |figures| &mut figures.force_n);
    }

    fn keep(&mut self, values: Option<[f64; AXES]>, of: impl Fn(&mut AxisFigures) -> &mut f64) {
        for (figures, value) in self.figures.iter_mut().zip(values.into_iter().flatten()) {
            let largest = of(figures);
            *largest = largest.max(value.abs());
        }
    }

    pub(super) fn finish(self) -> [AxisFigures; AXES] {
        self.figures
    }
}
