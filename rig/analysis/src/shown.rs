//! Figures that no verdict depends on: a report shows them, and a run without a report does without.

use masseter_can::Tapped;
use masseter_model::geometry::Pose;
use masseter_runtime::messages::codes::{ControllerState, NO_DRIVE_STATE};
use masseter_runtime::messages::{Command, FrameTap, Reading, Signals, State, Truth};
use masseter_scenario::Scenario;

use crate::intervals::Intervals;
use crate::jaw_cycles::JawCycles;
use crate::longest_cycles::LongestCycles;
use crate::over_time::{CONTROLLER, OverTimeCollector, PLANT};
use crate::pose_errors::pose;

/// Collects them.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    /// Whether the mechanism is emulated, so that its true motion is recorded.
    has_truth: bool,
    pub(super) intervals: Intervals,
    pub(super) longest_cycles: LongestCycles,
    pub(super) over_time: OverTimeCollector,
    pub(super) jaw_cycles: JawCycles,
}

impl Shown {
    pub(super) fn new(scenario: &Scenario) -> Self {
        Self {
            has_truth: scenario.can.is_virtual(),
            intervals: Intervals::new(scenario.period_ns()),
            longest_cycles: LongestCycles::default(),
            over_time: OverTimeCollector::new(scenario.jaw.reference_point_m, scenario.can.bitrate().ok()),
            jaw_cycles: JawCycles::new(scenario.jaw.reference_point_m, scenario.has_contact()),
        }
    }

    pub(super) fn command(&mut self, command: &Command) {
        self.intervals.command(command);
        self.longest_cycles.command(command);
    }

    /// `skipped`: deadlines skipped just before it.
    pub(super) fn reading(&mut self, reading: &Reading, skipped: u64) {
        self.intervals.reading(reading, skipped);
        self.longest_cycles.reading(reading);
        self.over_time.wake_up(PLANT, reading.due_ns, reading.woke_ns);
        if !self.has_truth && reading.drive_state.iter().all(|state| *state != NO_DRIVE_STATE) {
            self.over_time.reported(reading);
        }
    }

    /// `is_fresh`: the state's reading is used for the first time. `skipped`: deadlines skipped just before it.
    pub(super) fn state(&mut self, state: &State, is_fresh: bool, skipped: u64) {
        self.intervals.state(state, is_fresh, skipped);
        self.longest_cycles.state(state, is_fresh);
        self.over_time.wake_up(CONTROLLER, state.due_ns, state.woke_ns);
        if is_fresh {
            self.solution(state);
        }
    }

    fn solution(&mut self, state: &State) {
        if state.controller_state == ControllerState::Running.code() {
            self.over_time.running(state.sampled_ns);
        }
        let estimated = pose(state.estimated_position_m, state.estimated_quaternion_wxyz);
        if self.has_truth {
            self.over_time.estimated(state.sampled_ns, estimated.as_ref());
        } else {
            self.actual(state.sampled_ns, estimated.as_ref(), 0.0);
        }
    }

    /// The actual pose of the platform, and the vertical force on the jaw.
    fn actual(&mut self, sampled_ns: u64, actual: Option<&Pose>, force_n: f64) {
        self.over_time.actual(sampled_ns, actual);
        let since_ns = self.over_time.since(sampled_ns);
        if let Some(pose) = actual {
            self.jaw_cycles.take(since_ns, pose, force_n);
        }
    }

    pub(super) fn truth(&mut self, truth: &Truth) {
        let actual = pose(truth.position_m, truth.quaternion_wxyz);
        self.over_time.truth(truth);
        self.actual(truth.sampled_ns, actual.as_ref(), truth.bite_force_n);
    }

    pub(super) fn signals(&mut self, message: &Signals) {
        self.over_time.signals(message);
    }

    pub(super) fn frame(&mut self, tap: &FrameTap, bus: usize, tapped: &Tapped) {
        self.over_time.frame(tap.time_ns, bus, tapped);
    }
}
