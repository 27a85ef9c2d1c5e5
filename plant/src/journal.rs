//! Events that wait to be published: a bounded list that counts the events it has no room for.

use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

/// Events kept between two drains, of which one follows every cycle.
const CAPACITY: usize = 256;

/// The list.
#[derive(Debug)]
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
mod tests {
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
