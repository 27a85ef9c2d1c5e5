//! The master's events, and the reasons of a stop or of a failed boot.
//!
//! A [`Journal`] keeps events until their publication, and counts events without room. This module decides nothing.

use masseter_can::CanId;
use masseter_can::canopen::{Cob, Emergency, LengthError, ObjectAddress};
use masseter_model::geometry::AXES;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

use super::link::Address;

/// The subject of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Subject {
    Rig,
    Axis(usize),
    Bus(usize),
}

/// The log.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct EventLog {
    pub(super) journal: Journal,
    /// The cycle of new events.
    pub(super) cycle: u64,
    addresses: [Address; AXES],
}

impl EventLog {
    /// An empty log for drives with these node ids and buses.
    pub(super) fn new(addresses: [Address; AXES]) -> Self {
        Self { journal: Journal::new(), cycle: 0, addresses }
    }

    /// Adds an event.
    pub(super) fn add(&mut self, time_ns: u64, subject: Subject, event: Event) {
        let mut event = Event { time_ns, cycle: self.cycle, ..event };
        match subject {
            Subject::Rig => {}
            Subject::Bus(bus) => event.bus = bus as u16,
            Subject::Axis(axis) => {
                let Address { bus, node } = self.addresses[axis];
                (event.axis, event.node, event.bus) = (axis as u32, u16::from(node.get()), bus as u16);
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

/// A reason to stop the drives or to give up a boot, with the object, the value and the limit that explain the reason.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Failure {
    pub(super) cause: Cause,
    pub(super) object: Option<ObjectAddress>,
    pub(super) value: f64,
    pub(super) limit: f64,
}

impl Failure {
    /// A failure without an explaining value.
    pub(super) const fn new(cause: Cause) -> Self {
        Self { cause, object: None, value: 0.0, limit: 0.0 }
    }

    /// A failure explained by a value and its limit.
    pub(super) fn with(cause: Cause, value: impl Into<f64>, limit: impl Into<f64>) -> Self {
        Self { cause, object: None, value: value.into(), limit: limit.into() }
    }

    /// The event that reports it: a fault, or the same without a reaction.
    pub(super) fn event(&self, kind: EventKind) -> Event {
        let Self { cause, object, value, limit } = *self;
        let object = object.map_or(0, |object| u32::from(object.index) << 8 | u32::from(object.subindex));
        Event { object, value, limit, ..Event::new(Source::Master, kind, cause) }
    }
}

/// Events kept between two drains. A drain follows every cycle.
const CAPACITY: usize = 256;

/// The list.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Journal {
    events: Vec<Event>,
    lost: u64,
}

impl Journal {
    /// An empty list.
    pub(crate) fn new() -> Self {
        Self { events: Vec::with_capacity(CAPACITY), lost: 0 }
    }

    /// Adds an event, or counts it.
    pub(crate) fn add(&mut self, event: Event) {
        if self.events.len() < CAPACITY {
            self.events.push(event);
        } else {
            self.lost += 1;
        }
    }

    /// Hands out the events, and then the number of those without room.
    pub(crate) fn drain(&mut self, out: &mut impl FnMut(Event)) {
        let last = self.events.last().copied();
        self.events.drain(..).for_each(&mut *out);
        if let (Some(last), 1..) = (last, self.lost) {
            out(overflow(last.time_ns, last.cycle, self.lost));
            self.lost = 0;
        }
    }
}

/// The event that a full buffer has lost items.
pub(crate) fn overflow(time_ns: u64, cycle: u64, lost: u64) -> Event {
    let value = lost as f64;
    Event { time_ns, cycle, value, ..Event::new(Source::Master, EventKind::Notice, Cause::Overflow) }
}

#[cfg(test)]
mod failure_tests {
    use super::*;

    #[test]
    fn a_failure_is_reported_with_its_object_value_and_limit() {
        let object = Some(ObjectAddress::new(0x1018, 0x02));
        let event =
            Failure { object, ..Failure::with(Cause::WrongIdentity, 7.0, 8.0) }.event(EventKind::Fault);
        assert_eq!((event.cause, event.object), (Cause::WrongIdentity.code(), 0x10_1802));
        assert_eq!((event.value, event.limit), (7.0, 8.0));
        assert_eq!((event.kind, event.source), (EventKind::Fault.code(), Source::Master.code()));
        assert_eq!(Failure::new(Cause::BusOff).event(EventKind::Fault).object, 0);
    }
}

#[cfg(test)]
mod journal_tests {
    use super::*;

    #[test]
    fn events_without_room_are_counted_and_reported() {
        let mut journal = Journal::new();
        for cycle in 0..300 {
            journal.add(Event { cycle, ..Event::new(Source::Master, EventKind::Notice, Cause::Sequence) });
        }
        let mut drained = Vec::new();
        journal.drain(&mut |event| drained.push(event));
        assert_eq!(drained.len(), CAPACITY + 1);
        assert_eq!((drained[CAPACITY].cause, drained[CAPACITY].value), (Cause::Overflow.code(), 44.0));
        journal.drain(&mut |event| panic!("{event:?}"));
    }
}
