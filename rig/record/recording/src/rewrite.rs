//! New recordings from old ones: the readable part of a damaged one, or a thinned one.
//!
//! A recovered recording is whole. Messages, channels and attached files keep their bytes, numbers and times. Schemas
//! are numbered anew, since damage may have given two of them the same number. Metadata, which Masseter does not
//! write, are not carried over.
//!
//! A thinned recording has whole messages of a few cycles, and the digests of all. So it is small enough for a
//! repository. It still shows in which cycle and topic another run first differs from it, and soon after that by how
//! much.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Seek, Write};

use crc32fast::Hasher;
use mcap::{Attachment, McapError};

use crate::reader::{Entry, ReadError, Reader};
use crate::topic::{Recorded, Topic};
use crate::writer::{copy_channel, options, timeless};

/// A thinned recording has the messages of every so many cycles.
const EVERY: u64 = 100;
/// What the name of an attached digest begins with; the topic follows.
const NAME: &str = "digest of ";

/// Why a recording could not be recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// Nothing can be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new recording cannot be written.
    #[error("cannot write the recovered recording: {0}")]
    Write(#[from] McapError),
}

/// Counts of saved and lost messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Messages saved.
    pub messages: u64,
    /// Messages whose channel has no definition any more; they are not saved.
    pub undefined: u64,
}

/// Copies everything readable from `reader` to `medium`. The rest is in the reader's [`damage`](Reader::damage).
///
/// A channel whose schema is lost is defined without one, so that its messages are kept.
///
/// ```
/// use std::io::Cursor;
///
/// use masseter_recording::{Reader, Recorded, Recorder, Scene, recover};
/// # use masseter_scenario::Scenario;
/// # use masseter_model::geometry::{Mechanism, MechanismConfig};
/// # use masseter_runtime::messages::{Message, State};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("recording.mcap");
/// # let scene = Scene::new(&Mechanism::new(&MechanismConfig::default())?, &Scenario::default().jaw);
/// # let mut state = State::default();
/// # state.stamp(1, 1_000_000);
/// let mut recorder = Recorder::create(&path, scene)?;
/// recorder.record(&Recorded::State(state), 1_000_000)?;
/// recorder.flush()?;
/// let mut whole = Vec::new();
/// let recovered = recover(&mut Reader::open(&path)?, Cursor::new(&mut whole))?;
/// assert_eq!(recovered.undefined, 0);
/// assert!(Reader::new(Cursor::new(&whole))?.next_message()?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn recover<R: Read + Seek, W: Write + Seek>(
    reader: &mut Reader<R>,
    medium: W,
) -> Result<Recovered, RecoverError> {
    let mut writer = options().create(medium)?;
    let mut copied = Copied::default();
    let mut recovered = Recovered::default();
    while let Some(Entry { channel, header, data }) = reader.next_entry()? {
        if channel.is_none() {
            recovered.undefined += 1;
            continue;
        }
        if !copied.channels.contains(&header.channel_id) {
            copied.copy_new(reader, &mut writer)?;
        }
        writer.write_to_known_channel(&header, &data)?;
        recovered.messages += 1;
    }
    copied.copy_new(reader, &mut writer)?;
    writer.finish()?;
    Ok(recovered)
}

/// What has been copied beside messages. A reader of the new recording looks for it before the first message.
#[derive(Default)]
struct Copied {
    channels: BTreeSet<u16>,
    attachments: usize,
}

impl Copied {
    /// Copies the channels and attached files that the reader has come to know since the last call.
    fn copy_new<R: Read + Seek, W: Write + Seek>(
        &mut self,
        reader: &Reader<R>,
        writer: &mut mcap::Writer<W>,
    ) -> Result<(), McapError> {
        for attachment in &reader.attachments()[self.attachments..] {
            writer.attach(attachment)?;
        }
        self.attachments = reader.attachments().len();
        for channel in reader.channels() {
            if self.channels.insert(channel.id) {
                copy_channel(writer, channel)?;
            }
        }
        Ok(())
    }
}

/// Why a recording could not be thinned.
#[derive(Debug, thiserror::Error)]
pub enum ThinError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It lacks messages.
    #[error("the recording is incomplete: 'masseter recording verify' says where; record the run again")]
    Incomplete,
    /// Another run cannot give the same messages.
    #[error("a run in real time never gives the same messages again: record it with --clock virtual")]
    RealTime,
    /// It is thinned.
    #[error("the recording is thinned already: thin that of a whole run")]
    Thinned,
    /// The new recording cannot be written.
    #[error("cannot write the thinned recording: {0}")]
    Write(#[from] McapError),
}

/// Whether a thinned recording has this message.
pub fn is_kept(message: &Recorded) -> bool {
    match message.topic() {
        Topic::Frame | Topic::Machine => false,
        Topic::Event | Topic::Parameters => true,
        _ => message.cycle().is_some_and(|cycle| cycle % EVERY == 0),
    }
}

/// Writes the thinned recording of a run in simulated time to `medium`. Returns the number of messages that it keeps.
///
/// # Errors
/// [`ThinError`], before anything is written unless writing itself fails.
pub fn thin<R: Read + Seek, W: Write + Seek>(reader: &mut Reader<R>, medium: W) -> Result<u64, ThinError> {
    let (mut digester, mut kept) = (Digester::default(), Vec::new());
    while let Some(entry) = reader.next_entry()? {
        let messages = entry.messages()?;
        for message in &messages {
            digester.take(message);
        }
        // Of frames, which share an entry, only the digest is kept.
        kept.extend(messages.first().is_some_and(is_kept).then_some(entry));
    }
    if reader.was_cut_short() || !reader.damage().is_empty() {
        return Err(ThinError::Incomplete);
    }
    if reader.is_in_real_time() {
        return Err(ThinError::RealTime);
    }
    if !Digests::attached(reader.attachments()).is_empty() {
        return Err(ThinError::Thinned);
    }
    write_thinned(reader.attachments(), &digester.finish(), &kept, medium)?;
    Ok(kept.len() as u64)
}

/// Attached files come first, so that a reader knows them before the first message.
fn write_thinned<W: Write + Seek>(
    attachments: &[Attachment],
    digests: &Digests,
    kept: &[Entry],
    medium: W,
) -> Result<(), McapError> {
    let mut writer = options().create(medium)?;
    attachments.iter().try_for_each(|attachment| writer.attach(attachment))?;
    for (name, data) in digests.to_files() {
        writer.attach(&timeless(&name, "application/octet-stream", &data))?;
    }
    // Also the definitions of all channels do.
    let mut defined = BTreeSet::new();
    for channel in kept.iter().filter_map(|entry| entry.channel.as_ref()) {
        if defined.insert(channel.id) {
            copy_channel(&mut writer, channel)?;
        }
    }
    kept.iter().try_for_each(|Entry { header, data, .. }| writer.write_to_known_channel(header, data))?;
    writer.finish()?;
    Ok(())
}

/// The digest of a topic: that of all its messages, and its lowest byte after each cycle.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct TopicDigest {
    total: u32,
    after_cycles: Vec<u8>,
}

/// The digests of all messages of a recording, cycle by cycle: a byte for each topic.
///
/// A digest runs on from cycle to cycle, so that two recordings differ in it from their first difference on. A byte
/// overlooks a difference for a cycle with a probability of 1/256; the four bytes of the whole topic are compared too.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Digests(BTreeMap<Topic, TopicDigest>);

impl Digests {
    /// Those attached to a recording; empty if there are no such files.
    pub fn attached(attachments: &[Attachment]) -> Self {
        let read = |file: &Attachment| {
            let topic = Topic::named(file.name.strip_prefix(NAME)?)?;
            let (total, after_cycles) = file.data.split_first_chunk()?;
            let total = u32::from_le_bytes(*total);
            Some((topic, TopicDigest { total, after_cycles: after_cycles.to_vec() }))
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
            // Behind the last cycle only the whole digest may differ.
            let cycle = (same + 1).min(a.after_cycles.len().max(b.after_cycles.len()));
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
