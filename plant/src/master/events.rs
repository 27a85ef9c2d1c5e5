//! The master's events with time, cycle, and the axis or bus that they concern.
//!
//! The log decides nothing; it only completes events and keeps them until they are drained.

use masseter_can::CanId;
use masseter_can::canopen::{Cob, Emergency, LengthError, NodeId};
use masseter_model::geometry::AXES;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

use crate::journal::Journal;

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
    /// The cycle of new events.
    cycle: u64,
    /// Node id and bus of each axis.
    addresses: [(NodeId, usize); AXES],
}

impl EventLog {
    /// An empty log for drives with these node ids and buses.
    pub(super) fn new(addresses: [(NodeId, usize); AXES]) -> Self {
        Self { journal: Journal::new(), cycle: 0, addresses }
    }

    /// Begins a cycle.
    pub(super) fn begin_cycle(&mut self, cycle: u64) {
        self.cycle = cycle;
    }

    /// Hands out the events since the last drain.
    pub(super) fn drain(&mut self, out: &mut impl FnMut(Event)) {
        self.journal.drain(out);
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
}

/// An observation without a reaction.
pub(super) fn notice(cause: Cause) -> Event {
    Event::new(Source::Master, EventKind::Notice, cause)
}

/// A change of state.
pub(super) fn transition(source: Source, from: u32, to: u32) -> Event {
    Event { from, to, ..Event::new(source, EventKind::Transition, Cause::Sequence) }
}

/// An emergency message; one of the past needs no reaction.
pub(super) fn emergency(message: Emergency, is_past: bool) -> Event {
    let kind = if is_past { EventKind::Notice } else { EventKind::Fault };
    let (value, limit) = (f64::from(message.code.0), f64::from(message.register));
    Event { value, limit, ..Event::new(Source::Drive, kind, Cause::Emergency) }
}

/// An object with data of a wrong length.
pub(super) fn wrong_length(cob: Cob, error: &LengthError) -> Event {
    let (value, limit) = (error.actual as f64, error.expected as f64);
    Event { object: CanId::from(cob).number(), value, limit, ..notice(Cause::WrongLength) }
}
