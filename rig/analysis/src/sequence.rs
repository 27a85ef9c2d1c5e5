//! Counts messages and the gaps in their sequence numbers.

use std::collections::BTreeMap;

use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::Source;
use serde::Serialize;

use masseter_recording::{Recorded, Topic};

/// Messages and losses of one topic.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct TopicFigures {
    /// The topic.
    pub topic: &'static str,
    /// Messages recorded.
    pub messages: u64,
    /// Messages published before the last recorded one, but not recorded.
    pub missing: u64,
}

/// The process that publishes an event: master, drives and simulated wires are one process. The stimuli of a scenario belong
/// to the process that carries them out.
fn publisher_of(event: &Event) -> u32 {
    if event.is_of_controller() {
        return Source::Controller.code();
    }
    let is_of_plant =
        [Source::Drive, Source::Wire, Source::Scenario].map(Source::code).contains(&event.source);
    if is_of_plant { Source::Master.code() } else { event.source }
}

/// Follows every publisher of every topic. Each counts its own messages from 1.
#[derive(Debug, Clone, Default)]
pub struct SequenceCheck {
    /// Of the topics that one process publishes.
    topics: [Stream; Topic::ALL.len()],
    /// Of the events, by their publisher.
    events: BTreeMap<u32, Stream>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Stream {
    messages: u64,
    highest: u64,
}

impl SequenceCheck {
    /// Counts a message.
    pub fn take(&mut self, message: &Recorded) {
        let stream = match message {
            Recorded::Event(event) => self.events.entry(publisher_of(event)).or_default(),
            _ => &mut self.topics[message.topic() as usize],
        };
        stream.messages += 1;
        stream.highest = stream.highest.max(message.seq());
    }

    /// The counts of every topic.
    pub fn finish(self) -> Vec<TopicFigures> {
        let figures = Topic::ALL.into_iter().map(|topic| {
            let events = self.events.values().filter(|_| topic == Topic::Event);
            let streams = events.chain([&self.topics[topic as usize]]);
            streams.fold(TopicFigures { topic: topic.name(), messages: 0, missing: 0 }, |sum, stream| {
                let missing = stream.highest.saturating_sub(stream.messages);
                TopicFigures {
                    messages: sum.messages + stream.messages,
                    missing: sum.missing + missing,
                    ..sum
                }
            })
        });
        let mut figures: Vec<_> = figures.filter(|topic| topic.messages > 0).collect();
        figures.sort_by_key(|topic| topic.topic);
        figures
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::Reading;

    use super::*;

    #[test]
    fn gaps_are_counted_at_the_beginning_and_between_for_each_publisher() {
        let mut check = SequenceCheck::default();
        let mut event = |source: Source, seq| {
            check.take(&Recorded::Event(Event { seq, source: source.code(), ..Event::default() }));
        };
        for seq in [3, 4, 7] {
            event(Source::Controller, seq);
        }
        // One process.
        event(Source::Master, 1);
        event(Source::Drive, 2);
        check.take(&Recorded::Reading(Reading { seq: 1, ..Reading::default() }));
        assert_eq!(
            check.finish(),
            [
                TopicFigures { topic: "event", messages: 5, missing: 4 },
                TopicFigures { topic: "reading", messages: 1, missing: 0 },
            ]
        );
    }
}
