//! Stops that the drives and their master show, whatever the controller reports.

use masseter_shared::messages::Reading;
use masseter_shared::messages::codes::DriveState;
use serde::Serialize;

use crate::events::EventRecord;

/// What stopped the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StoppedBy {
    /// A fault that the master found: it then stops all drives.
    Master,
    /// A request for a quick stop, which the drives carry out.
    QuickStop,
}

/// Watches drives and master for a stop.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StopWatch {
    stopped: Option<StoppedBy>,
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
        found.is_some()
    }

    /// The master's own report, should the run end before the next reading.
    pub(super) fn event(&mut self, event: &EventRecord) {
        self.stopped = self.stopped.or(event.is_fault_of_master().then_some(StoppedBy::Master));
    }

    /// What stopped the drives, and for how many cycles all of them were enabled.
    pub(super) fn finish(self) -> (Option<StoppedBy>, u64) {
        (self.stopped, self.enabled_cycles)
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::geometry::AXES;
    use masseter_shared::messages::Event;
    use masseter_shared::messages::codes::{Cause, EventKind, Source};

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
