//! Stops that the drives and their master show, whatever the controller reports.

use masseter_model::geometry::AXES;
use masseter_runtime::messages::codes::{DriveState, NO_DRIVE_STATE};
use masseter_runtime::messages::{Reading, State};
use serde::Serialize;

use crate::events::EventRecord;
use crate::tracking::is_moving;

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
    pub(super) fn reading(&mut self, reading: &Reading) -> bool {
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
    pub(super) fn state(&mut self, state: &State) {
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
    pub(super) fn event(&mut self, event: &EventRecord) {
        self.stopped = self.stopped.or(event.is_fault_of_master().then_some(StoppedBy::Master));
    }

    /// What stopped the drives, and for how many cycles all of them were enabled.
    pub(super) fn finish(self) -> (Option<StoppedBy>, u64) {
        (self.stopped.or(self.has_left.then_some(StoppedBy::Drives)), self.enabled_cycles)
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Event;
    use masseter_runtime::messages::codes::{Cause, ControllerState, EventKind, Source};

    use super::*;

    fn reading(state: DriveState, master_fault: u32) -> Reading {
        Reading { drive_state: [state.code(); AXES], master_fault, ..Reading::default() }
    }

    /// Of one reading a cycle.
    fn seen(readings: &[Reading]) -> (Option<StoppedBy>, u64) {
        let mut watch = StopWatch::default();
        for (cycle, reading) in (1..).zip(readings) {
            watch.reading(&Reading { cycle, ..*reading });
        }
        watch.finish()
    }

    #[test]
    fn a_fault_of_the_master_and_a_quick_stop_of_enabled_drives_are_stops() {
        let enabled = reading(DriveState::OperationEnabled, 0);
        let quick = reading(DriveState::QuickStopActive, 0);
        let off = reading(DriveState::SwitchOnDisabled, 0);
        let fault = reading(DriveState::SwitchOnDisabled, 1);
        let cases: [(&[Reading], _); 6] = [
            (&[off, enabled, enabled, off], (None, 2)),
            (&[off, enabled, quick, off], (Some(StoppedBy::QuickStop), 1)),
            (&[enabled, fault, off], (Some(StoppedBy::Master), 1)),
            (&[enabled, quick, fault], (Some(StoppedBy::QuickStop), 1)),
            (&[fault], (Some(StoppedBy::Master), 0)),
            // Nothing moved before.
            (&[quick, off], (None, 0)),
        ];
        for (readings, expected) in cases {
            assert_eq!(seen(readings), expected);
        }
        let mut one_is_off = enabled;
        one_is_off.drive_state[3] = DriveState::SwitchedOn.code();
        assert_eq!(seen(&[one_is_off, quick]), (None, 0));
    }

    #[test]
    fn a_drive_that_leaves_operation_while_the_motion_runs_is_a_stop() {
        use ControllerState::{Disabling, Enabling, Holding, Running, SafeStop};
        type Case<'a> = (&'a [(Reading, ControllerState)], Option<StoppedBy>);
        let enabled = reading(DriveState::OperationEnabled, 0);
        let quick = reading(DriveState::QuickStopActive, 0);
        let fault = reading(DriveState::SwitchOnDisabled, 1);
        let mut left = enabled;
        left.drive_state[3] = DriveState::SwitchOnDisabled.code();
        let mut silent = enabled;
        silent.drive_state[3] = NO_DRIVE_STATE;
        let cases: [Case<'_>; 8] = [
            (&[(enabled, Running), (left, Running), (left, Running)], Some(StoppedBy::Drives)),
            (&[(enabled, Holding), (left, Holding), (enabled, Holding)], Some(StoppedBy::Drives)),
            // The controller ends the motion, one cycle late at most.
            (&[(enabled, Running), (enabled, Disabling), (left, Disabling)], None),
            (&[(enabled, Running), (left, Running), (left, SafeStop)], None),
            (&[(enabled, Enabling), (left, Enabling), (enabled, Running), (enabled, Running)], None),
            (&[(enabled, Running), (silent, Running), (enabled, Running)], None),
            // The first cause of such a state.
            (&[(enabled, Running), (left, Running), (fault, Running)], Some(StoppedBy::Master)),
            (&[(enabled, Running), (left, Running), (quick, Running)], Some(StoppedBy::QuickStop)),
        ];
        for (messages, expected) in cases {
            let mut watch = StopWatch::default();
            for (cycle, (reading, state)) in (1..).zip(messages) {
                watch.reading(&Reading { cycle, due_ns: 10 * cycle, ..*reading });
                let controller_state = state.code();
                watch.state(&State { cycle, due_ns: 10 * cycle + 5, controller_state, ..State::default() });
            }
            assert_eq!(watch.finish().0, expected);
        }
    }

    #[test]
    fn the_masters_report_counts_without_a_reading_and_no_other_report_does() {
        let stop = |source, kind| {
            let mut watch = StopWatch::default();
            watch.event(&EventRecord::from(&Event::new(source, kind, Cause::BadMessage)));
            watch.finish().0
        };
        assert_eq!(stop(Source::Master, EventKind::Fault), Some(StoppedBy::Master));
        assert_eq!(stop(Source::Master, EventKind::Notice), None);
        assert_eq!(stop(Source::Drive, EventKind::Fault), None);
        assert_eq!(stop(Source::Controller, EventKind::Fault), None);
    }
}
