//! How much of the scenario's motion was played, and what stopped the drives.
//!
//! The controller states its motion time. It counts only as far as cycles passed, and the pose that belongs to it is computed
//! from the scenario. A stop shows in drives and master, whatever the controller reports.

use std::sync::Arc;

use masseter_controller::trajectory::Trajectory;
use masseter_model::geometry::{AXES, Mechanism};
use masseter_runtime::messages::codes::{Cause, DriveState, NO_DRIVE_STATE};
use masseter_runtime::messages::{Event, Reading, State};
use masseter_runtime::named::{Declared, PlayedMotion};
use masseter_scenario::Scenario;
use serde::Serialize;

use crate::events::EventRecord;
use crate::tracking::{desired_pose, deviation, is_moving, worse};

/// Cycles that the motion's time may catch up: a reading that comes late has the time of the sample before.
const LATE_CYCLES: f64 = 2.0;
/// Share of the motion that may pass in cycles without a state, which lost cycles explain.
const UNSEEN: f64 = 0.05;
/// Less is rounding, s.
const ROUNDING_S: f64 = 1e-6;
/// The parameter of the rig's motion controller that lets it play a part of the motion's way.
const AMPLITUDE: &str = "motion_amplitude";

/// The greatest distance of the stated desired pose from the scenario's motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Departure {
    /// Of the incisal point, mm.
    pub incisal_mm: f64,
    /// Angle, degrees.
    pub deg: f64,
    /// When the incisal point was so far away, s of the motion's time.
    pub at_s: f64,
    /// Whether the rest of the motion was not compared, since the amplitude was set.
    pub is_partial: bool,
}

/// Follows the motion's time.
#[derive(Debug, Clone, Default)]
pub(super) struct PlayedWatch {
    period_s: f64,
    incisal_m: [f64; 3],
    /// None where the desired poses are not the scenario's: in an own motion, with force control, at another amplitude.
    scenario: Option<Arc<Trajectory>>,
    amplitude_place: Option<usize>,
    /// Cycle and motion time of the last state of the motion.
    last: Option<(u64, f64)>,
    /// What the motion's time may catch up, s.
    credit_s: f64,
    /// The motion's time jumped or vanished: what follows is no part of it.
    has_jumped: bool,
    /// How far the motion came before.
    reached_s: Option<f64>,
    /// The part of it that passed in cycles without a state, s.
    unseen_s: f64,
    departure: Option<Departure>,
}

impl PlayedWatch {
    pub(super) fn new(scenario: &Scenario, declared: &Declared) -> Self {
        let is_amplitude = |name: &String| name == AMPLITUDE;
        let is_scaled = scenario.parameters.keys().any(is_amplitude)
            || scenario.stimulus.iter().filter_map(|stimulus| stimulus.parameter.as_ref()).any(is_amplitude);
        let has_poses =
            declared.motion == PlayedMotion::Scenario && scenario.force_control.is_none() && !is_scaled;
        Self {
            period_s: scenario.period_s(),
            incisal_m: scenario.jaw.reference_point_m,
            scenario: has_poses.then(|| trajectory(scenario)).flatten(),
            amplitude_place: declared.place_of(AMPLITUDE).ok(),
            credit_s: LATE_CYCLES * scenario.period_s(),
            ..Self::default()
        }
    }

    /// Takes a state. Once the motion has begun, a state without its time ends it.
    pub(super) fn apply_state(&mut self, state: &State) {
        let time_s = state.motion_time_s;
        if !is_moving(state) || time_s.is_nan() || time_s < 0.0 {
            self.has_jumped |= self.last.is_some();
            return;
        }
        let (cycle, before_s) = self.last.replace((state.cycle, time_s)).unwrap_or((state.cycle, 0.0));
        let passed_s = state.cycle.saturating_sub(cycle) as f64 * self.period_s;
        let (step_s, late_s) = (time_s - before_s, LATE_CYCLES * self.period_s);
        let credit_s = self.credit_s + passed_s - step_s;
        // A motion that waits may not make up for it later.
        self.credit_s = credit_s.min(late_s);
        self.has_jumped |= credit_s < -ROUNDING_S;
        let reached_s = self.reached_s.get_or_insert(0.0);
        if !self.has_jumped {
            *reached_s = reached_s.max(time_s);
            self.unseen_s += (step_s - self.period_s - late_s).max(0.0);
            self.compare(state);
        }
    }

    /// The stated desired desired_pose, beside the scenario's at this time of the motion.
    fn compare(&mut self, state: &State) {
        let Some(scenario) = &self.scenario else { return };
        let at_s = state.motion_time_s;
        let stated = desired_pose(state);
        let apart = deviation(stated.as_ref(), Some(&scenario.pose_in_motion(at_s)), self.incisal_m);
        let (mm, deg) = (apart.incisal_m * 1e3, apart.angle_rad.to_degrees());
        let greatest =
            self.departure.get_or_insert(Departure { incisal_mm: 0.0, deg: 0.0, at_s, is_partial: false });
        if mm > greatest.incisal_mm {
            (greatest.incisal_mm, greatest.at_s) = (mm, at_s);
        }
        greatest.deg = worse(greatest.deg, deg);
    }

    /// Once the amplitude is set, other poses are desired.
    pub(super) fn apply_event(&mut self, event: &Event) {
        let is_set = event.cause == Cause::ParameterSet.code();
        if is_set && self.amplitude_place == Some(event.object as usize) {
            self.scenario = None;
            self.departure.iter_mut().for_each(|departure| departure.is_partial = true);
        }
    }

    /// How far the motion came, s, and how far the desired pose was from it. What passed unseen counts only as a small share.
    pub(super) fn into_figures(self) -> (Option<f64>, Option<Departure>) {
        let unseen_s = self.unseen_s;
        let seen_s = |reached_s: f64| {
            if unseen_s > UNSEEN * reached_s { (reached_s - unseen_s).max(0.0) } else { reached_s }
        };
        (self.reached_s.map(seen_s), self.departure)
    }
}

/// The scenario's motion; none where its file is gone since the run.
fn trajectory(scenario: &Scenario) -> Option<Arc<Trajectory>> {
    let mechanism = Mechanism::new(&scenario.mechanism).ok()?;
    Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s).ok().map(Arc::new)
}

/// States after the reading of a drive that left operation. The controller may miss that reading in the first.
const STILL_MOVING: u32 = 2;

/// What stopped the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StoppedBy {
    /// A fault that the master found: it then stops all drives.
    Master,
    /// A request for a quick stop, which the drives carry out.
    QuickStop,
    /// A drive left operation while the motion ran.
    Drives,
}

/// Watches drives and master for a stop.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StopWatch {
    stopped: Option<StoppedBy>,
    was_enabled: [bool; AXES],
    /// The newest state is one of the motion.
    is_moving: bool,
    /// When a drive left operation in the motion, ns, and how many states of the motion came since.
    left: Option<(u64, u32)>,
    has_left: bool,
    last_cycle: u64,
    /// Cycles in which all drives were enabled.
    enabled_cycles: u64,
}

impl StopWatch {
    /// Takes a reading. Returns whether it is that of a stop.
    pub(super) fn apply_reading(&mut self, reading: &Reading) -> bool {
        let is_in = |state: DriveState| move |code: &u32| *code == state.code();
        let states = &reading.drive_state;
        let passed = reading.cycle.saturating_sub(self.last_cycle);
        self.last_cycle = reading.cycle;
        if states.iter().all(is_in(DriveState::OperationEnabled)) {
            self.enabled_cycles += passed;
        }
        let is_quick = self.enabled_cycles > 0 && states.iter().any(is_in(DriveState::QuickStopActive));
        let found = match reading.master_fault {
            0 => is_quick.then_some(StoppedBy::QuickStop),
            _ => Some(StoppedBy::Master),
        };
        self.stopped = self.stopped.or(found);
        self.leave(reading);
        found.is_some()
    }

    /// Notes a drive that leaves operation. One that is not heard of shows nothing.
    fn leave(&mut self, reading: &Reading) {
        for (code, was_enabled) in reading.drive_state.iter().zip(&mut self.was_enabled) {
            if *code == NO_DRIVE_STATE {
                continue;
            }
            let is_enabled = *code == DriveState::OperationEnabled.code();
            let has_left = std::mem::replace(was_enabled, is_enabled) && !is_enabled;
            if has_left && self.is_moving {
                self.left.get_or_insert((reading.due_ns, 0));
            }
        }
    }

    /// Takes a state. A controller that ends its motion with the drives is no stop of theirs.
    pub(super) fn apply_state(&mut self, state: &State) {
        self.is_moving = is_moving(state);
        let Some((left_ns, states)) = &mut self.left else { return };
        // The state of an earlier cycle may come later.
        if state.due_ns <= *left_ns {
            return;
        }
        *states += 1;
        if !self.is_moving {
            self.left = None;
        } else if *states >= STILL_MOVING {
            self.has_left = true;
        }
    }

    /// The master's own report, should the run end before the next reading.
    pub(super) fn apply_event(&mut self, event: &EventRecord) {
        self.stopped = self.stopped.or(event.is_fault_of_master().then_some(StoppedBy::Master));
    }

    /// What stopped the drives, and for how many cycles all of them were enabled.
    pub(super) fn into_figures(self) -> (Option<StoppedBy>, u64) {
        (self.stopped.or(self.has_left.then_some(StoppedBy::Drives)), self.enabled_cycles)
    }
}

#[cfg(test)]
mod tests;
