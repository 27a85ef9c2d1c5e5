//! Events waiting to be published: a bounded list that counts what it has no room for.

use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, EventKind, NO_AXIS, Source};

/// Events kept between two drains; a drain follows every cycle.
const CAPACITY: usize = 256;

/// The list.
#[derive(Debug)]
pub(super) struct Journal {
    events: Vec<Event>,
    lost: u64,
}

impl Journal {
    pub(super) fn new() -> Self {
        Self { events: Vec::with_capacity(CAPACITY), lost: 0 }
    }

    pub(super) fn add(&mut self, event: Event) {
        if self.events.len() < CAPACITY {
            self.events.push(event);
        } else {
            self.lost += 1;
        }
    }

    /// Hands out the events, and at the end how many had no room.
    pub(super) fn drain(&mut self, out: &mut impl FnMut(Event)) {
        let last = self.events.last().copied();
        self.events.drain(..).for_each(&mut *out);
        if let (Some(last), 1..) = (last, self.lost) {
            out(overflow(last.time_ns, last.cycle, self.lost));
            self.lost = 0;
        }
    }
}

/// So many items of a full buffer were lost.
pub(super) fn overflow(time_ns: u64, cycle: u64, lost: u64) -> Event {
    Event {
        time_ns,
        cycle,
        source: Source::Master.code(),
        kind: EventKind::Notice.code(),
        cause: Cause::Overflow.code(),
        axis: NO_AXIS,
        value: lost as f64,
        ..Event::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_no_room_is_counted_and_told() {
        let mut journal = Journal::new();
        for cycle in 0..300 {
            journal.add(Event { cycle, ..Event::default() });
        }
        let mut drained = Vec::new();
        journal.drain(&mut |event| drained.push(event));
        assert_eq!(drained.len(), CAPACITY + 1);
        assert_eq!((drained[CAPACITY].cause, drained[CAPACITY].value), (Cause::Overflow.code(), 44.0));
        journal.drain(&mut |event| panic!("{event:?}"));
    }
}
