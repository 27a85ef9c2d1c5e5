//! One pass over a recording: its contents, its gaps, and its damage.

use std::fmt::{Error, Write};
use std::{collections::BTreeMap, path::Path};

use anyhow::Context;
use masseter_judge::{SequenceCheck, TopicFigures};
use masseter_recording::{Chunks, Digests, Entry, ReadError, Reader, Recorded};
use masseter_runtime::messages::codes::ControllerState;
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Tone};

/// Figures of one channel.
#[derive(Debug, Clone, Default)]
struct ChannelFigures {
    messages: u64,
    bytes: u64,
    first_ns: u64,
    last_ns: u64,
    /// Messages that this program cannot decode, and the reason for the first.
    unreadable: u64,
    reason: Option<String>,
}

/// Contents, gaps and damage of a recording.
pub(crate) struct Survey {
    /// At the end of the recording.
    pub(crate) reader: Reader,
    channels: Vec<(mcap::Channel<'static>, ChannelFigures)>,
    sequences: Vec<TopicFigures>,
    undefined: u64,
    /// Whether it is a golden run, which keeps few messages.
    is_thinned: bool,
    /// When the sample of the motion's first cycle was taken, ns; none without a motion.
    pub(crate) motion_ns: Option<u64>,
}

impl Survey {
    /// Reads a recording to its end.
    pub(crate) fn of_file(path: &Path) -> anyhow::Result<Self> {
        let read = || Self::of_reader(Reader::open(path)?);
        read().with_context(|| path.display().to_string())
    }

    fn of_reader(mut reader: Reader) -> Result<Self, ReadError> {
        let mut channels: BTreeMap<u16, ChannelFigures> = BTreeMap::new();
        let mut sequence = SequenceCheck::default();
        let (mut undefined, mut motion_ns) = (0, None);
        while let Some(entry) = reader.next_entry()? {
            let Some(channel) = &entry.channel else {
                undefined += 1;
                continue;
            };
            let figures = channels.entry(channel.id).or_default();
            figures.count_entry(&entry);
            for message in entry.messages().unwrap_or_else(|error| figures.count_unreadable(&error)) {
                sequence.take(&message);
                if let Recorded::State(state) = message
                    && state.controller_state == ControllerState::Running.code()
                {
                    motion_ns.get_or_insert(crate::tables::time_ns(&message));
                }
            }
        }
        let figures = |channel: &mcap::Channel<'static>| {
            (channel.clone(), channels.remove(&channel.id).unwrap_or_default())
        };
        let channels = reader.channels().map(figures).collect();
        let is_thinned = !Digests::attached(reader.attachments()).is_empty();
        Ok(Self { reader, channels, sequences: sequence.finish(), undefined, is_thinned, motion_ns })
    }

    /// The rig's topics with messages that this program can read.
    pub(crate) fn topics(&self) -> impl Iterator<Item = &'static str> {
        self.sequences.iter().filter(|topic| topic.messages > 0).map(|topic| topic.topic)
    }

    fn unreadable(&self) -> u64 {
        self.channels.iter().map(|(_, figures)| figures.unreadable).sum()
    }

    /// Topics without some of their messages, which a thinned recording leaves out on purpose.
    fn incomplete_topics(&self) -> impl Iterator<Item = &TopicFigures> {
        self.sequences.iter().filter(|topic| topic.missing > 0 && !self.is_thinned)
    }

    /// Whether the file has no damage, except that its last bytes may be missing.
    fn is_undamaged_to_its_end(&self) -> bool {
        match self.reader.damage() {
            [] => true,
            [tail] => self.reader.was_cut_short() && tail.to == self.reader.size(),
            _ => false,
        }
    }

    /// The exit code of a verb that read this recording.
    pub(crate) fn exit(&self) -> Exit {
        if self.unreadable() + self.undefined > 0 || !self.is_undamaged_to_its_end() {
            Exit::Usage
        } else if self.reader.was_cut_short() || self.incomplete_topics().next().is_some() {
            Exit::Incomplete
        } else {
            Exit::Passed
        }
    }

    /// A summary of the contents.
    pub(crate) fn info(&self) -> Result<String, Error> {
        let mut text = String::new();
        let chunks = self.reader.chunks();
        let compression = if chunks.compression.is_empty() { "no compression" } else { &chunks.compression };
        let (size, count, unpacked) =
            (self.reader.size(), counted(chunks.count, "chunk"), chunks.uncompressed_bytes);
        let share = chunks.compressed_bytes as f64 / unpacked.max(1) as f64;
        writeln!(text, "{size} bytes; {count}, {compression}, {share:.2} of their {unpacked} bytes")?;
        if let Some(cycles) = self.cycles() {
            let bytes = size as f64 / cycles as f64;
            writeln!(text, "{}, {bytes:.0} bytes a cycle", counted(cycles, "cycle"))?;
        }
        writeln!(text, "{:<8} {:>9} {:>10} {:>10}  schema", "topic", "messages", "Hz", "bytes each")?;
        for (mcap::Channel { topic, schema, message_encoding, .. }, figures) in &self.channels {
            let (messages, rate) = (figures.messages, figures.rate());
            let bytes = figures.bytes as f64 / messages.max(1) as f64;
            let schema = schema.as_ref().map_or("no schema", |schema| &schema.name);
            writeln!(
                text,
                "{topic:<8} {messages:>9} {rate:>10} {bytes:>10.0}  {schema} ({message_encoding})"
            )?;
        }
        if !self.reader.has_frames() {
            writeln!(text, "{:<8} not recorded (recording.frames = false)", "frames")?;
        }
        for file in self.reader.attachments() {
            writeln!(text, "attached: {}, {}", file.name, counted(file.data.len() as u64, "byte"))?;
        }
        let received =
            || self.channels.iter().map(|(_, figures)| figures).filter(|figures| figures.messages > 0);
        let from_ns = received().map(|figures| figures.first_ns).min().unwrap_or(0);
        let to_ns = received().map(|figures| figures.last_ns).max().unwrap_or(0);
        writeln!(text, "recorded from {from_ns} to {to_ns} ns, {:.3} s", (to_ns - from_ns) as f64 / 1e9)?;
        Ok(text + &self.loss_with_advice()?)
    }

    /// Recorded cycles: the controller publishes one state in each.
    fn cycles(&self) -> Option<u64> {
        let (_, states) = self.channels.iter().find(|(channel, _)| channel.topic == "state")?;
        (states.messages > 0).then_some(states.messages)
    }

    /// The result of every check.
    pub(crate) fn verification(&self) -> Result<String, Error> {
        let mut text = String::new();
        for topic in &self.sequences {
            let TopicFigures { topic, messages, missing } = topic;
            let (mark, between) =
                if self.is_thinned { (mark_of(0), "left out") } else { (mark_of(*missing), "missing") };
            let messages = counted(*messages, "message");
            writeln!(text, "{mark} {topic:<8} {messages:>18}, {missing} {between} between them")?;
        }
        if !self.reader.has_frames() {
            writeln!(text, "–    {:<8} {:>18}", "frame", "not recorded")?;
        }
        let &Chunks { count, damaged, .. } = self.reader.chunks();
        writeln!(text, "{} chunks with their checksum: {count}, without: {damaged}", mark_of(damaged))?;
        let unreadable: u64 = self.reader.damage().iter().map(|damage| damage.to - damage.from).sum();
        writeln!(
            text,
            "{} {unreadable} of {} bytes cannot be read",
            mark_of(unreadable),
            self.reader.size()
        )?;
        let end = if self.reader.was_cut_short() { "lacks" } else { "has" };
        writeln!(text, "{} the file {end} its end", mark_of(self.reader.was_cut_short().into()))?;
        Ok(text + &self.loss_with_advice()?)
    }

    /// The thinned, missing or unreadable parts, and the remedy; empty for a complete recording.
    pub(crate) fn loss_with_advice(&self) -> Result<String, Error> {
        let mut text = self.loss()?;
        if self.reader.was_cut_short() {
            writeln!(text, "'masseter recording recover' writes a file with an end")?;
        }
        Ok(text)
    }

    /// The thinned, missing or unreadable parts, with their places.
    pub(crate) fn loss(&self) -> Result<String, Error> {
        let mut text = String::new();
        if self.is_thinned {
            writeln!(text, "thinned: it keeps few messages, and the digests of all")?;
        }
        for damage in self.reader.damage() {
            writeln!(text, "unreadable: {damage}")?;
        }
        for topic in self.incomplete_topics() {
            writeln!(text, "missing: {} on '{}'", counted(topic.missing, "message"), topic.topic)?;
        }
        for (_, figures) in &self.channels {
            if let Some(reason) = &figures.reason {
                writeln!(text, "unreadable: {}; {reason}", counted(figures.unreadable, "message"))?;
            }
        }
        if self.undefined > 0 {
            let undefined = counted(self.undefined, "message");
            writeln!(text, "unreadable: {undefined} without a definition of the channel")?;
        }
        if self.reader.was_cut_short() {
            writeln!(text, "the file lacks its end")?;
        }
        Ok(text)
    }
}

/// The marks of lines.
pub(crate) const TONES: [(&str, Tone); 2] = [("ok", Tone::Good), ("FAIL", Tone::Bad)];

/// The mark of a line with so many faults.
fn mark_of(faults: u64) -> &'static str {
    if faults == 0 { "ok  " } else { "FAIL" }
}

impl ChannelFigures {
    /// Messages a second, in words.
    fn rate(&self) -> String {
        let seconds = (self.last_ns - self.first_ns) as f64 / 1e9;
        if self.messages < 2 || seconds <= 0.0 {
            return "–".to_owned();
        }
        format!("{:.1}", (self.messages - 1) as f64 / seconds)
    }

    fn count_entry(&mut self, entry: &Entry) {
        if self.messages == 0 {
            self.first_ns = entry.header.log_time;
        }
        self.first_ns = self.first_ns.min(entry.header.log_time);
        self.last_ns = self.last_ns.max(entry.header.log_time);
        self.messages += 1;
        self.bytes += entry.data.len() as u64;
    }

    /// Counts a message that this program cannot read, and returns none.
    fn count_unreadable(&mut self, error: &ReadError) -> Vec<Recorded> {
        self.unreadable += 1;
        self.reason.get_or_insert_with(|| error.to_string());
        Vec::new()
    }
}
