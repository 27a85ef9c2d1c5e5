//! The digests of all messages of a recording, cycle by cycle: a byte for each topic.
//!
//! A digest runs on from cycle to cycle, so that two recordings differ in it from their first difference on. A byte
//! overlooks a difference for a cycle with a probability of 1/256; the four bytes of the whole topic are compared too.

use std::collections::{BTreeMap, BTreeSet};

use crc32fast::Hasher;
use mcap::Attachment;

use super::topic::{Recorded, Topic};

/// What the name of an attached digest begins with; the topic follows.
const NAME: &str = "digest of ";

/// The digest of a topic: that of all its messages, and its lowest byte after each cycle.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct TopicDigest {
    total: u32,
    after_cycles: Vec<u8>,
}

/// The digests of a recording's topics.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Digests(BTreeMap<Topic, TopicDigest>);

impl Digests {
    /// Those attached to a recording; empty where there are none.
    pub fn attached(attachments: &[Attachment]) -> Self {
        let read = |file: &Attachment| {
            let topic = Topic::named(file.name.strip_prefix(NAME)?)?;
            let (total, after_cycles) = file.data.split_first_chunk()?;
            Some((
                topic,
                TopicDigest { total: u32::from_le_bytes(*total), after_cycles: after_cycles.to_vec() },
            ))
        };
        Self(attachments.iter().filter_map(read).collect())
    }

    /// Name and content of the files to attach.
    pub(super) fn to_files(&self) -> impl Iterator<Item = (String, Vec<u8>)> {
        self.0.iter().map(|(topic, TopicDigest { total, after_cycles })| {
            (format!("{NAME}{}", topic.name()), [&total.to_le_bytes(), after_cycles.as_slice()].concat())
        })
    }

    /// Whether there are any.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether there is one of the topic.
    pub fn has(&self, topic: Topic) -> bool {
        self.0.contains_key(&topic)
    }

    /// Each topic that differs, with the cycle in which it first does.
    pub fn differences(&self, other: &Self) -> Vec<(Topic, u64)> {
        let topics: BTreeSet<_> = self.0.keys().chain(other.0.keys()).collect();
        let none = TopicDigest::default();
        let first = |topic: &Topic| {
            let [a, b] = [self, other].map(|digests| digests.0.get(topic).unwrap_or(&none));
            let same = a.after_cycles.iter().zip(&b.after_cycles).take_while(|(a, b)| a == b).count();
            let cycle = if a.after_cycles.len() == b.after_cycles.len() && same == a.after_cycles.len() {
                same
            } else {
                same + 1
            };
            (a != b).then_some((*topic, cycle as u64))
        };
        topics.into_iter().filter_map(first).collect()
    }
}

/// Computes digests from messages in the order of a recording.
#[derive(Debug, Default)]
pub struct Digester {
    running: BTreeMap<Topic, (Hasher, Vec<u8>)>,
    cycles: usize,
}

impl Digester {
    /// Takes a message. Events and parameters are rare: a thinned recording has them all.
    pub fn take(&mut self, message: &Recorded) {
        let topic = message.topic();
        if matches!(topic, Topic::Event | Topic::Parameters | Topic::Machine) {
            return;
        }
        if topic == Topic::Reading {
            // The first message of a cycle.
            self.end_cycle();
            self.cycles += 1;
        }
        let cycles = self.cycles;
        // A topic that begins later has had no message before.
        let begin = || (Hasher::new(), vec![0; cycles.saturating_sub(1)]);
        self.running.entry(topic).or_insert_with(begin).0.update(message.body());
    }

    fn end_cycle(&mut self) {
        for (digest, after_cycles) in self.running.values_mut() {
            if after_cycles.len() < self.cycles {
                after_cycles.push(digest.clone().finalize() as u8);
            }
        }
    }

    /// The digests of all messages.
    pub fn finish(mut self) -> Digests {
        self.end_cycle();
        let digest =
            |(digest, after_cycles): (Hasher, _)| TopicDigest { total: digest.finalize(), after_cycles };
        Digests(self.running.into_iter().map(|(topic, running)| (topic, digest(running))).collect())
    }
}

#[cfg(test)]
mod tests {
    use masseter_runtime::messages::{Command, Reading};

    use super::*;

    fn digests(targets_m: &[f64]) -> Digests {
        let mut digester = Digester::default();
        for (cycle, target_m) in (1..).zip(targets_m) {
            digester.take(&Recorded::Reading(Reading { cycle, ..Reading::default() }));
            digester.take(&Recorded::Command(Command {
                cycle,
                target_m: [*target_m; 6],
                ..Command::default()
            }));
        }
        digester.finish()
    }

    #[test]
    fn the_first_cycle_of_a_difference_is_found_for_its_topic_also_at_the_end_and_where_one_goes_on() {
        let a = digests(&[0.1, 0.2, 0.3]);
        for (other, expected) in [
            (&[0.1, 0.2, 0.3][..], vec![]),
            (&[0.1, 0.200_001, 0.3], vec![(Topic::Command, 2)]),
            (&[0.1, 0.2, 0.300_001], vec![(Topic::Command, 3)]),
            (&[0.1, 0.2], vec![(Topic::Command, 3), (Topic::Reading, 3)]),
            (&[0.1, 0.2, 0.3, 0.4], vec![(Topic::Command, 4), (Topic::Reading, 4)]),
        ] {
            assert_eq!(a.differences(&digests(other)), expected, "{other:?}");
        }
    }

    #[test]
    fn attached_digests_are_read_again() {
        let digests = digests(&[0.1, 0.2]);
        let files: Vec<_> = digests.to_files().collect();
        let attached = files.iter().map(|(name, data)| Attachment {
            log_time: 0,
            create_time: 0,
            name: name.clone(),
            media_type: String::new(),
            data: data.as_slice().into(),
        });
        assert_eq!(Digests::attached(&attached.collect::<Vec<_>>()), digests);
    }
}
