//! The order of the messages of a run in lockstep: that in which virtual time records them.
//!
//! All messages of a cycle have arrived once the next reading has. They are ordered by their stamps; those with the same
//! stamp, by their publishers.

use std::collections::VecDeque;

use masseter_recording::Recorded;

/// The publishers.
const LANES: usize = 10;

/// Messages that wait for their turn.
#[derive(Debug, Default)]
pub(super) struct InOrder {
    /// Those of each publisher, oldest first; publishers in the order of their work.
    lanes: [VecDeque<Recorded>; LANES],
    /// When the newest reading was published, ns: everything older is there.
    complete_before_ns: u64,
}

impl InOrder {
    /// Adds a message that has arrived.
    pub(super) fn add(&mut self, message: &Recorded) {
        let lane = match message {
            Recorded::Reading(reading) => {
                self.complete_before_ns = reading.published_ns;
                0
            }
            Recorded::Truth(_) => 1,
            Recorded::Contact(_) => 2,
            Recorded::Command(_) => 3,
            Recorded::State(_) => 4,
            Recorded::Signals(_) => 5,
            Recorded::Parameters(_) => 6,
            Recorded::Event(event) if event.is_of_controller() => 7,
            Recorded::Frame(_) => 8,
            Recorded::Event(_) | Recorded::Machine(_) => 9,
        };
        self.lanes[lane].push_back(*message);
    }

    /// Hands out, in order, the messages of complete cycles, or all of them at the end.
    pub(super) fn drain(&mut self, is_last: bool, mut take: impl FnMut(&Recorded)) {
        let before_ns = if is_last { u64::MAX } else { self.complete_before_ns };
        let stamp = |lane: &VecDeque<Recorded>| lane.front().map_or(u64::MAX, Recorded::published_ns);
        // The first of equals.
        while let Some(lane) = self.lanes.iter_mut().min_by_key(|lane| stamp(lane))
            && stamp(lane) < before_ns
            && let Some(message) = lane.pop_front()
        {
            take(&message);
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::codes::Source;
    use masseter_runtime::messages::{Command, Contact, Event, FrameTap, Message, Reading, State, Truth};

    use super::*;

    fn stamped<M: Message + Into<Recorded>>(mut message: M, published_ns: u64) -> Recorded {
        message.stamp(1, published_ns);
        message.into()
    }

    #[test]
    fn messages_of_complete_cycles_come_in_the_order_of_virtual_time() {
        let of_controller = Event { source: Source::Controller.code(), ..Event::default() };
        let of_plant = Event { source: Source::Master.code(), ..Event::default() };
        let cycle = |start_ns: u64| {
            [
                stamped(Reading::default(), start_ns + 5),
                stamped(Truth::default(), start_ns + 5),
                stamped(Contact::default(), start_ns + 5),
                stamped(Command::default(), start_ns + 6),
                stamped(State::default(), start_ns + 6),
                stamped(of_controller, start_ns + 6),
                stamped(FrameTap::default(), start_ns + 6),
                stamped(of_plant, start_ns + 6),
            ]
        };
        let [first, second] = [cycle(0), cycle(10)];
        let mut in_order = InOrder::default();
        // Topic by topic, the events in any order of their publishers.
        for place in [0, 3, 4, 1, 2, 6, 7, 5] {
            in_order.add(&first[place]);
            in_order.add(&second[place]);
        }
        let drained = |in_order: &mut InOrder, is_last| {
            let mut drained = Vec::new();
            in_order.drain(is_last, |message| drained.push(*message));
            drained
        };
        assert_eq!(drained(&mut in_order, false), first);
        assert_eq!(drained(&mut in_order, false), []);
        assert_eq!(drained(&mut in_order, true), second);
    }
}
