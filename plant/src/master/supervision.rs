//! What the master watches, and when it stops the drives for good.

use masseter_shared::can::SendError;
use masseter_shared::can::canopen::NmtState;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, DriveCondition, DriveRequest, EventKind, NO_AXIS, Source};

use super::cycle::Master;

/// Cycles that an operational drive's process data may be missing.
const MISSING_CYCLES: u32 = 3;

impl Master {
    /// Judges the cycle: silent drives, missing process data, drives that left operation by themselves.
    pub(super) fn supervise(&mut self, now_ns: u64) {
        let shall_be_enabled = self.request() == DriveRequest::Enable;
        let mut all_enabled = true;
        for axis in 0..AXES {
            let node = &mut self.nodes[axis];
            if node.is_operational() && !node.is_fresh {
                node.missing_cycles += 1;
            }
            let (nmt, missing) = (node.nmt, node.missing_cycles);
            let silent_ns = now_ns.saturating_sub(node.heard_ns);
            let condition = node.condition();
            all_enabled &= condition == DriveCondition::OperationEnabled;
            if nmt.is_some() && silent_ns > self.settings.heartbeat_timeout_ns {
                let limit_ns = self.settings.heartbeat_timeout_ns;
                self.fail(now_ns, Cause::HeartbeatLost, Some(axis), [silent_ns, limit_ns].map(in_ms));
            } else if missing > MISSING_CYCLES {
                let values = [missing, MISSING_CYCLES].map(f64::from);
                self.fail(now_ns, Cause::ProcessDataLost, Some(axis), values);
            } else if shall_be_enabled && self.were_enabled && condition != DriveCondition::OperationEnabled {
                self.fail(now_ns, Cause::DriveFault, Some(axis), [f64::from(condition.code()), 0.0]);
            } else if nmt != Some(NmtState::Operational) {
                self.watch_boot(now_ns, axis);
            }
        }
        self.were_enabled = shall_be_enabled && (self.were_enabled || all_enabled);
    }

    fn watch_boot(&mut self, now_ns: u64, axis: usize) {
        let waited_ns = now_ns.saturating_sub(self.began_ns);
        if waited_ns > self.settings.boot_timeout_ns {
            let limit_ns = self.settings.boot_timeout_ns;
            self.fail(now_ns, Cause::BootTimeout, Some(axis), [waited_ns, limit_ns].map(in_ms));
        }
    }

    /// Stops the drives for good. The first cause is reported, its consequences are not.
    pub(super) fn fail(&mut self, now_ns: u64, cause: Cause, axis: Option<usize>, values: [f64; 2]) {
        if !self.has_fault {
            self.has_fault = true;
            self.report(now_ns, Source::Master, EventKind::Fault, cause, axis, values);
        }
    }

    pub(super) fn check_sent(&mut self, result: Result<(), SendError>) {
        if result.is_err() {
            self.fail(self.wake.woke_ns, Cause::BusRefused, None, [0.0; 2]);
        }
    }

    /// Writes an event down; `value` and `limit` in the cause's unit.
    pub(super) fn report(
        &mut self,
        time_ns: u64,
        source: Source,
        kind: EventKind,
        cause: Cause,
        axis: Option<usize>,
        [value, limit]: [f64; 2],
    ) {
        self.journal.add(Event {
            time_ns,
            cycle: self.wake.cycle,
            source: source.code(),
            kind: kind.code(),
            cause: cause.code(),
            axis: axis.map_or(NO_AXIS, |axis| axis as u32),
            value,
            limit,
            ..Event::default()
        });
    }
}

fn in_ms(ns: u64) -> f64 {
    ns as f64 / 1e6
}
