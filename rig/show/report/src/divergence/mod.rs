//! Two streams of messages side by side: the first message in which they differ, and how each difference grows.
//!
//! `masseter diff` compares two recordings, `masseter replay` a recording with the answers of a controller. Numbers are
//! compared bit by bit. Figures of two runs are compared by [`compare`](crate::compare).

mod differences;
mod lane;

use std::path::{Path, PathBuf};
use std::{collections::BTreeMap, fs::File, io::BufReader};

use anyhow::{Context, ensure};
use masseter_recording::{Columns, Digester, Digests, Reader, Recorded, Topic, is_kept, recording_at};
use masseter_terminal::{Exit, Format, result};

use self::differences::{DigestDifference, FORM, MotionClock};
use self::lane::{Lane, LaneKey};

pub use differences::{Compared, Differences};

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
        let (lanes, clock, unrecorded) = (BTreeMap::new(), MotionClock::default(), Vec::new());
        Self { compared, columns, lanes, clock, unrecorded }
    }

    /// Takes the next message of one side, and compares what has a partner.
    pub fn take(&mut self, side: Side, message: &Recorded) {
        let compared = self.compared;
        if !compared.has_topic(message.topic()) || self.unrecorded.contains(&message.topic()) {
            return;
        }
        if side == Side::A {
            self.clock.add_message(message);
        }
        // A frame belongs to the cycle in which it is recorded.
        let cycle = message.cycle().unwrap_or(self.clock.cycle);
        let columns = self.columns.get(&message.topic());
        let lane = self.lanes.entry(LaneKey::of(message)).or_default();
        lane.push(side as usize, cycle, message);
        lane.compare_partners(columns, |field| compared.has_field(field));
    }

    /// The differences of all messages.
    pub fn finish(self) -> Differences {
        self.finish_with(Vec::new())
    }

    /// The same, where digests of messages that were not compared differ by topic from these cycles on.
    fn finish_with(self, mut digests: Vec<(Topic, u64)>) -> Differences {
        let Self { compared, columns, lanes, clock, unrecorded } = self;
        digests.retain(|(topic, _)| !unrecorded.contains(topic));
        digests.sort_by_key(|(_, first_cycle)| *first_cycle);
        let digests = digests.into_iter().map(|(topic, cycle)| (topic.name(), cycle));
        let digests: Vec<_> =
            digests.map(|(topic, first_cycle)| DigestDifference { topic, first_cycle }).collect();
        let unrecorded = unrecorded.iter().map(|topic| topic.name()).collect();
        let (mut messages, mut fields, mut one_sided, mut redefined) =
            (0, Vec::new(), Vec::new(), Vec::new());
        for (key, lane) in lanes {
            messages += lane.messages;
            if lane.messages > 0 && !columns.contains_key(&key.topic()) {
                redefined.push(key.topic().name());
            }
            let (mut growths, missing) = lane.into_differences();
            for growth in &mut growths {
                growth.motion_s = clock.motion_s(growth.first_cycle);
            }
            fields.append(&mut growths);
            one_sided.extend(missing.into_iter().flatten());
        }
        // Each source of a topic has a lane.
        redefined.dedup();
        fields.sort_by_key(|field| field.first_cycle);
        one_sided.sort_by_key(|missing| missing.first_cycle);
        Differences {
            form: FORM,
            is_equal: fields.is_empty() && one_sided.is_empty() && redefined.is_empty() && digests.is_empty(),
            messages,
            fields,
            one_sided,
            redefined,
            unrecorded,
            digests,
            compared,
            clock,
        }
    }
}

/// What a reader may want to know next.
const FURTHER: &str = "'masseter report A B' compares the figures of two runs.";

/// A recording that is being read.
struct Stream {
    path: PathBuf,
    reader: Reader<BufReader<File>>,
    next: Option<Recorded>,
    /// Of a thinned recording.
    digests: Digests,
    digester: Digester,
}

impl Stream {
    /// Opens a recording, or that of a run folder.
    fn open(path: &Path) -> anyhow::Result<Self> {
        let path = recording_at(path)?;
        let name = || path.display().to_string();
        let mut reader = Reader::open(&path).with_context(name)?;
        // Before the first message come the definitions of all channels, and the attached files.
        let next = reader.next_message().with_context(name)?;
        let digests = Digests::attached(reader.attachments());
        Ok(Self { path, reader, next, digests, digester: Digester::default() })
    }

    /// Whether it has the CAN frames, or their digest.
    fn has_frames(&self) -> bool {
        self.reader.has_frames() || self.digests.has(Topic::Frame)
    }

    fn next_message(&mut self) -> anyhow::Result<Option<Recorded>> {
        let Some(message) = self.next else { return Ok(None) };
        self.digester.take(&message);
        self.next = self.reader.next_message().with_context(|| self.path.display().to_string())?;
        Ok(Some(message))
    }

    /// The digests of all messages, also of those that a thinned recording does not have. Refuses a damaged recording.
    fn into_digests(self) -> anyhow::Result<Digests> {
        let path = self.path.display();
        let is_whole = self.reader.damage().is_empty() && !self.reader.was_cut_short();
        ensure!(is_whole, "{path} is incomplete: 'masseter recording verify' says where");
        Ok(if self.digests.is_empty() { self.digester.finish() } else { self.digests })
    }
}

/// `masseter diff A B`.
///
/// ```no_run
/// use masseter_report::divergence;
/// use masseter_terminal::Format;
///
/// divergence::recordings("runs/before".as_ref(), "runs/after".as_ref(), Format::Human)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When a recording cannot be read to its end.
pub fn recordings(a: &Path, b: &Path, format: Format) -> anyhow::Result<Exit> {
    let differences = compare(Stream::open(a)?, Stream::open(b)?)?;
    result(&match format {
        Format::Human => differences.in_words(["A", "B"]) + FURTHER + "\n",
        Format::Json => serde_json::to_string_pretty(&differences)? + "\n",
    })?;
    Ok(differences.exit())
}

fn compare(mut a: Stream, mut b: Stream) -> anyhow::Result<Differences> {
    let is_in_real_time = a.reader.is_in_real_time() || b.reader.is_in_real_time();
    let compared = if is_in_real_time { Compared::WithoutTimes } else { Compared::Everything };
    let columns = [&a, &b].map(|stream| Columns::of_topics(stream.reader.channels()));
    let mut comparison = Comparison::new(compared, columns);
    if a.has_frames() != b.has_frames() && compared.has_topic(Topic::Frame) {
        comparison.unrecorded.push(Topic::Frame);
    }
    let is_thinned = [&a, &b].iter().any(|stream| !stream.digests.is_empty());
    // In turn, so that few messages wait for their partners.
    let mut has_more = true;
    while has_more {
        has_more = false;
        for (side, stream) in [(Side::A, &mut a), (Side::B, &mut b)] {
            if let Some(message) = stream.next_message()? {
                has_more = true;
                if !is_thinned || is_kept(&message) {
                    comparison.take(side, &message);
                }
            }
        }
    }
    let [a, b] = [a.into_digests()?, b.into_digests()?];
    Ok(comparison.finish_with(if is_thinned { a.differences(&b) } else { Vec::new() }))
}
