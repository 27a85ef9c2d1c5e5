//! What the master watches, and when it stops the drives.

use masseter_can::canopen::NmtState;
use masseter_can::{Bus, ErrorState, SendError};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{
    BootPhase, Cause, DriveRequest, DriveState, EventKind, Source, drive_state_code,
};

use super::boot::BootFault;
use super::cycle::{Master, Stop};
use crate::link::Buses;

/// Cycles that an operational drive's process data may be missing.
const MISSING_CYCLES: u32 = 3;
/// New process data beyond one a SYNC that a single node may send: those that may be missing may also come late, all
/// at once.
pub(super) const SURPLUS: u32 = MISSING_CYCLES + 2;

/// What an event is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Place {
    Nowhere,
    Axis(usize),
    Bus(usize),
}

impl Master {
    /// Judges the cycle: silent drives, missing process data, drives that left operation by themselves.
    pub(super) fn supervise(&mut self, now_ns: u64) {
        let shall_be_enabled = self.request() == DriveRequest::Enable;
        let mut all_enabled = true;
        for axis in 0..AXES {
            let phase = self.nodes[axis].boot.phase();
            match phase {
                BootPhase::Waiting => self.watch_waiting(now_ns, axis),
                BootPhase::Configured | BootPhase::Ready => self.watch_node(now_ns, axis),
                _ => {}
            }
            let state = self.nodes[axis].drive_state();
            let is_enabled = state == Some(DriveState::OperationEnabled);
            all_enabled &= is_enabled;
            if shall_be_enabled && self.were_enabled && !is_enabled {
                let values = [f64::from(drive_state_code(state)), 0.0];
                self.fail(now_ns, Cause::DriveFault, Place::Axis(axis), values);
            }
        }
        self.were_enabled = shall_be_enabled && (self.were_enabled || all_enabled);
    }

    /// A verified node must be heard, and an operational one answer every SYNC, once.
    fn watch_node(&mut self, now_ns: u64, axis: usize) {
        let is_fresh = self.is_fresh(axis);
        let node = &mut self.nodes[axis];
        if !is_fresh {
            node.miss_cycle();
        }
        let (silent_ns, surplus, missing) = (node.silent_ns(now_ns), node.surplus(), node.missing_cycles());
        let (cause, values) = if silent_ns > self.settings.heartbeat_timeout_ns {
            let limit_ns = self.settings.heartbeat_timeout_ns;
            (Cause::HeartbeatLost, [silent_ns, limit_ns].map(in_ms))
        } else if surplus > SURPLUS {
            (Cause::DuplicateNode, [surplus, SURPLUS].map(f64::from))
        } else if missing > MISSING_CYCLES {
            (Cause::ProcessDataLost, [missing, MISSING_CYCLES].map(f64::from))
        } else if let Some(state) = node.stopped_in() {
            (Cause::NodeStopped, [state, NmtState::Operational].map(|state| f64::from(state.code())))
        } else {
            return;
        };
        let before = node.boot.phase();
        node.forget(now_ns);
        self.fail(now_ns, cause, Place::Axis(axis), values);
        self.note_boot(now_ns, axis, before, Ok(()));
    }

    /// Tells once that a node which was never there does not come. One that was lost is known to be.
    fn watch_waiting(&mut self, now_ns: u64, axis: usize) {
        let limit_ns = self.settings.boot_timeout_ns;
        let node = &mut self.nodes[axis];
        let waited_ns = node.boot.waited_ns(now_ns);
        if waited_ns > limit_ns && node.miss() {
            let [value, limit] = [waited_ns, limit_ns].map(in_ms);
            self.fail_boot(
                now_ns,
                axis,
                &BootFault { cause: Cause::BootTimeout, object: None, value, limit },
            );
        }
    }

    /// A bus that went off is reported, and so is its return; its drives have stopped by themselves.
    pub(super) fn watch_buses(&mut self, now_ns: u64, buses: &mut impl Buses) {
        for bus in 0..self.settings.buses {
            let status = buses.port(bus).status();
            let is_off = status.state == ErrorState::BusOff;
            if is_off == self.buses[bus].is_off {
                continue;
            }
            self.buses[bus].is_off = is_off;
            let value = f64::from(status.tec);
            if is_off {
                self.fail(now_ns, Cause::BusOff, Place::Bus(bus), [value, 0.0]);
            } else {
                let recovered = Event::new(Source::Master, EventKind::Notice, Cause::Recovered);
                self.tell(now_ns, Place::Bus(bus), Event { value, ..recovered });
            }
        }
    }

    /// Stops the drives. The first cause is reported with the value and the limit that explain it, its consequences
    /// are not.
    pub(super) fn fail(&mut self, now_ns: u64, cause: Cause, place: Place, [value, limit]: [f64; 2]) {
        let stop = match cause {
            Cause::CommandLost | Cause::BadMessage | Cause::DriveFault => Stop::ForGood,
            _ => Stop::UntilRestored,
        };
        if self.fault.is_none() {
            self.fault = Some(stop);
            let fault = Event::new(Source::Master, EventKind::Fault, cause);
            self.tell(now_ns, place, Event { value, limit, ..fault });
        }
    }

    /// Leaves the drives to another master, for good even if something else has stopped them before.
    pub(super) fn give_way(&mut self, now_ns: u64, bus: usize) {
        if self.fault != Some(Stop::ForGood) {
            self.fault = Some(Stop::ForGood);
            let second = Event::new(Source::Master, EventKind::Fault, Cause::SecondMaster);
            self.tell(now_ns, Place::Bus(bus), second);
        }
    }

    pub(super) fn check_sent(&mut self, bus: usize, result: Result<(), SendError>) {
        let is_known = match result {
            Ok(()) => return,
            // A bus that is off is reported as such.
            Err(SendError::BusOff { .. }) => true,
            // Before any drive is switched on, nobody acknowledges; those that do not come are reported.
            Err(SendError::QueueFull { .. }) => !self.buses[bus].is_heard,
            Err(_) => false,
        };
        if !is_known {
            self.fail(self.wake.woke_ns, Cause::BusRefused, Place::Bus(bus), [0.0; 2]);
        }
    }

    /// Writes an event down, with when and where it happened.
    pub(super) fn tell(&mut self, time_ns: u64, place: Place, event: Event) {
        let mut event = Event { time_ns, cycle: self.wake.cycle, ..event };
        match place {
            Place::Nowhere => {}
            Place::Bus(bus) => event.bus = bus as u16,
            Place::Axis(axis) => {
                let node = &self.nodes[axis];
                (event.axis, event.node, event.bus) =
                    (axis as u32, u16::from(node.id.get()), node.bus as u16);
            }
        }
        self.journal.add(event);
    }
}

fn in_ms(ns: u64) -> f64 {
    ns as f64 / 1e6
}
