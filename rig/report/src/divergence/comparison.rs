//! Compares two streams of messages while they are read.

use std::collections::BTreeMap;

use masseter_recording::{Columns, Digests, Recorded, Topic};

use super::compared::Compared;
use super::differences::Differences;
use super::lane::{Lane, LaneKey};
use super::motion_clock::MotionClock;

/// One of the two streams.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// The first.
    A,
    /// The second.
    B,
}

/// Two streams, message by message.
///
/// ```
/// use masseter_recording::{Columns, Recorded, definitions};
/// use masseter_report::divergence::{Compared, Comparison, Side};
/// use masseter_runtime::messages::Command;
/// use masseter_runtime::named::Declared;
///
/// let definitions = definitions(&Declared::default());
/// let columns = || Columns::of_topics(definitions.iter().map(|(_, channel)| channel));
/// let mut comparison = Comparison::new(Compared::Everything, [columns(), columns()]);
/// for (side, request) in [(Side::A, 1), (Side::B, 2)] {
///     comparison.take(side, &Recorded::Command(Command { cycle: 7, request, ..Command::default() }));
/// }
/// let words = comparison.finish().in_words(["A", "B"]);
/// assert!(words.starts_with("DIFFERENT from cycle 7 on: command.request is 1 in A, 2 in B"), "{words}");
/// ```
#[derive(Debug)]
pub struct Comparison {
    compared: Compared,
    /// Of the topics whose messages have the same fields on both sides.
    columns: BTreeMap<Topic, Columns>,
    lanes: BTreeMap<LaneKey, Lane>,
    clock: MotionClock,
    /// Topics that one side has not recorded.
    unrecorded: Vec<Topic>,
}

impl Comparison {
    /// A comparison of messages with these definitions.
    pub fn new(compared: Compared, [mut columns, of_b]: [BTreeMap<Topic, Columns>; 2]) -> Self {
        columns.retain(|topic, columns| of_b.get(topic) == Some(columns));
        Self {
            compared,
            columns,
            lanes: BTreeMap::new(),
            clock: MotionClock::default(),
            unrecorded: Vec::new(),
        }
    }

    /// Leaves a topic out that one side has not recorded. The differences name it.
    pub(super) fn leave_out(&mut self, topic: Topic) {
        self.unrecorded.extend(self.compared.has_topic(topic).then_some(topic));
    }

    /// Takes the next message of one side, and compares what has a partner.
    pub fn take(&mut self, side: Side, message: &Recorded) {
        let compared = self.compared;
        if !compared.has_topic(message.topic()) || self.unrecorded.contains(&message.topic()) {
            return;
        }
        if side == Side::A {
            self.clock.take(message);
        }
        // A frame belongs to the cycle in which it is recorded.
        let cycle = message.cycle().unwrap_or(self.clock.cycle);
        let columns = self.columns.get(&message.topic());
        let lane = self.lanes.entry(LaneKey::of(message)).or_default();
        lane.push(side as usize, cycle, message);
        lane.settle(columns, |field| compared.has_field(field));
    }

    /// The differences of all messages.
    pub fn finish(self) -> Differences {
        self.finish_with(&Digests::default(), &Digests::default())
    }

    /// The same, with the digests of messages that were not compared.
    pub(super) fn finish_with(self, a: &Digests, b: &Digests) -> Differences {
        let Self { compared, columns, lanes, clock, unrecorded } = self;
        let mut digests = a.differences(b);
        digests.retain(|(topic, _)| !unrecorded.contains(topic));
        let mut differences = Differences::new(compared, clock, &unrecorded);
        differences.add_digests(digests);
        for (key, lane) in lanes {
            differences.add(key.topic(), columns.contains_key(&key.topic()), lane);
        }
        differences
    }
}
