//! What a report shows of a run, and no verdict depends on: intervals, the longest cycles, curves, and cycles of the jaw.

use masseter_runtime::messages::codes::NO_DRIVE_STATE;
use masseter_runtime::messages::{Command, Reading, State, Truth};
use masseter_scenario::Scenario;

use crate::jaw_cycles::{JawCycles, MotionSpeed};
use crate::over_time::{CONTROLLER, OverTime, PLANT, Place};
use crate::poses::{estimated_pose, is_running, true_pose};
use crate::{
    figures::Figures, intervals::Intervals, longest_cycles::LongestCycles, signals::CycleMessages,
    tracking::PathSample,
};

/// Collects them.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    /// Whether the mechanism is emulated, so that its true motion is recorded.
    has_truth: bool,
    intervals: Intervals,
    pub(super) longest_cycles: LongestCycles,
    pub(super) over_time: OverTime,
    jaw_cycles: JawCycles,
}

impl Shown {
    /// For a run whose controller declares so many signals.
    pub(super) fn new(scenario: &Scenario, signals: usize) -> Self {
        let (incisal_m, bitrate) = (scenario.jaw.reference_point_m, scenario.can.bitrate().ok());
        Self {
            has_truth: scenario.can.is_virtual(),
            intervals: Intervals::new(scenario.period_ns()),
            longest_cycles: LongestCycles::default(),
            over_time: OverTime::new(incisal_m, bitrate, signals),
            jaw_cycles: JawCycles::new(scenario),
        }
    }

    pub(super) fn apply_command(&mut self, command: &Command) {
        self.intervals.apply_command(command);
        self.longest_cycles.apply_command(command);
    }

    /// `skipped`: deadlines skipped just before it.
    pub(super) fn apply_reading(&mut self, reading: &Reading, skipped: u64) {
        self.intervals.apply_reading(reading, skipped);
        self.longest_cycles.apply_reading(reading);
        self.over_time.wake_up(PLANT, reading.due_ns, reading.woke_ns);
        let has_states = reading.drive_state.iter().all(|state| *state != NO_DRIVE_STATE);
        match (self.has_truth, has_states) {
            (true, _) => self.over_time.reported_beside_truth(reading),
            (false, true) => self.over_time.reported(reading),
            (false, false) => {}
        }
    }

    /// `is_fresh`: the state's reading is used for the first time. `skipped`: deadlines skipped just before it.
    pub(super) fn apply_state(&mut self, state: &State, is_fresh: bool, skipped: u64) {
        self.intervals.apply_state(state, is_fresh, skipped);
        self.longest_cycles.apply_state(state, is_fresh);
        self.over_time.wake_up(CONTROLLER, state.due_ns, state.woke_ns);
        if is_fresh {
            if is_running(Some(state.controller_state)) {
                self.over_time.running(state.sampled_ns);
            }
            let of = if self.has_truth { Place::Estimated } else { Place::Actual };
            self.over_time.incisal(of, state.sampled_ns, estimated_pose(state).as_ref());
        }
    }

    pub(super) fn apply_path(&mut self, path: &PathSample, messages: &CycleMessages, speed: MotionSpeed) {
        self.over_time.apply_path(path);
        let played_ns = self.over_time.since_motion(path.sampled_ns);
        let played_ns = played_ns.filter(|_| is_running(messages.controller_state));
        if let Some((played_ns, actual)) = played_ns.zip(path.actual) {
            let force_n = messages.truth.map_or(0.0, |truth| truth.bite_force_n);
            self.jaw_cycles.add_pose(played_ns, &actual, force_n, speed);
        }
    }

    pub(super) fn apply_truth(&mut self, truth: &Truth) {
        self.over_time.apply_truth(truth);
        self.over_time.incisal(Place::Actual, truth.sampled_ns, true_pose(truth).as_ref());
    }

    /// Adds the figures.
    pub(super) fn add_to(self, figures: &mut Figures) {
        figures.intervals = self.intervals.into_figures();
        figures.worst_cycles = self.longest_cycles.into_figures();
        figures.over_time = self.over_time;
        figures.jaw_cycles = self.jaw_cycles.into_figures();
    }
}
