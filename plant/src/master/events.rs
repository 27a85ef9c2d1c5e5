//! The master's events with time, cycle, and the axis or bus that they concern.
//!
//! The log decides nothing; it only completes events and keeps them until they are drained.

use masseter_can::canopen::NodeId;
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Event;

use crate::journal::{Journal, overflow};

/// The subject of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    Rig,
    Axis(usize),
    Bus(usize),
}

/// The log.
#[derive(Debug)]
pub(super) struct EventLog {
    journal: Journal,
    cycle: u64,
    /// Node id and bus of each axis.
    addresses: [(NodeId, usize); AXES],
}

impl EventLog {
    /// An empty log for drives with these node ids and buses.
    pub(super) fn new(addresses: [(NodeId, usize); AXES]) -> Self {
        Self { journal: Journal::new(), cycle: 0, addresses }
    }

    /// Events belong to this cycle from now on.
    pub(super) fn begin_cycle(&mut self, cycle: u64) {
        self.cycle = cycle;
    }

    /// Adds an event.
    pub(super) fn add(&mut self, time_ns: u64, subject: Subject, event: Event) {
        let mut event = Event { time_ns, cycle: self.cycle, ..event };
        match subject {
            Subject::Rig => {}
            Subject::Bus(bus) => event.bus = bus as u16,
            Subject::Axis(axis) => {
                let (id, bus) = self.addresses[axis];
                (event.axis, event.node, event.bus) = (axis as u32, u16::from(id.get()), bus as u16);
            }
        }
        self.journal.add(event);
    }

    /// Adds that tapped frames had no room.
    pub(super) fn add_lost(&mut self, time_ns: u64, lost: u64) {
        self.journal.add(overflow(time_ns, self.cycle, lost));
    }

    /// Hands out the events since the last drain.
    pub(super) fn drain(&mut self, out: &mut impl FnMut(Event)) {
        self.journal.drain(out);
    }
}
