//! Counts messages and the gaps in their sequence numbers.

use std::collections::BTreeMap;

use masseter_shared::messages::Event;
use masseter_shared::messages::codes::Source;
use serde::Serialize;

use masseter_recording::Recorded;

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
#[derive(Debug, Default)]
pub struct SequenceCheck {
    streams: BTreeMap<(&'static str, u32), Stream>,
}

#[derive(Debug, Default)]
struct Stream {
    messages: u64,
    highest: u64,
}

impl SequenceCheck {
    /// Counts a message.
    pub fn take(&mut self, message: &Recorded) {
        let publisher = match message {
            Recorded::Event(event) => publisher_of(event),
            _ => 0,
        };
        let stream = self.streams.entry((message.topic().name(), publisher)).or_default();
        stream.messages += 1;
        stream.highest = stream.highest.max(message.seq());
    }

    /// The counts of every topic.
    pub fn finish(self) -> Vec<TopicFigures> {
        let mut topics: Vec<TopicFigures> = Vec::new();
        for ((topic, _), stream) in self.streams {
            let missing = stream.highest.saturating_sub(stream.messages);
            match topics.last_mut().filter(|last| last.topic == topic) {
                Some(last) => {
                    last.messages += stream.messages;
                    last.missing += missing;
                }
                None => topics.push(TopicFigures { topic, messages: stream.messages, missing }),
            }
        }
        topics
    }
}

#[cfg(test)]
mod tests {
    use masseter_shared::messages::Reading;

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
