//! One pass over a recording: its contents, its gaps, and its damage.

use std::collections::BTreeMap;
use std::fmt::{Error, Write};
use std::io::{Read, Seek};

use masseter_analysis::{SequenceCheck, TopicFigures};
use masseter_recording::{Chunks, Damage, Digests, Entry, ReadError, Reader, Recorded};
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
#[derive(Debug)]
pub(crate) struct Survey {
    size: u64,
    channels: Vec<(mcap::Channel<'static>, ChannelFigures)>,
    sequences: Vec<TopicFigures>,
    undefined: u64,
    /// Names and bytes of the attached files.
    attachments: Vec<(String, usize)>,
    chunks: Chunks,
    damage: Vec<Damage>,
    was_cut_short: bool,
    has_frames: bool,
    /// Whether it is a golden run, which keeps few messages.
    is_thinned: bool,
    /// When the sample of the motion's first cycle was taken, ns; none without a motion.
    motion_ns: Option<u64>,
}

impl Survey {
    /// Reads the recording to its end.
    pub(crate) fn read<R: Read + Seek>(reader: &mut Reader<R>) -> Result<Self, ReadError> {
        let mut channels: BTreeMap<u16, ChannelFigures> = BTreeMap::new();
        let mut sequence = SequenceCheck::default();
        let (mut undefined, mut motion_ns) = (0, None);
        while let Some(entry) = reader.next_entry()? {
            let Some(channel) = &entry.channel else {
                undefined += 1;
                continue;
            };
            channels.entry(channel.id).or_default().add(&entry);
            if let Some(Ok(message)) = entry.recorded() {
                sequence.take(&message);
                if let Recorded::State(state) = message
                    && state.controller_state == ControllerState::Running.code()
                {
                    motion_ns.get_or_insert(if state.sampled_ns > 0 {
                        state.sampled_ns
                    } else {
                        state.due_ns
                    });
                }
            }
            for frame in entry.frames().into_iter().flatten().flatten() {
                sequence.take(&Recorded::Frame(frame));
            }
        }
        let channels = reader.channels().map(|channel| {
            let figures = channels.remove(&channel.id).unwrap_or_default();
            (channel.clone(), figures)
        });
        let channels = channels.collect();
        Ok(Self {
            size: reader.size(),
            channels,
            sequences: sequence.finish(),
            undefined,
            attachments: reader
                .attachments()
                .iter()
                .map(|file| (file.name.clone(), file.data.len()))
                .collect(),
            chunks: reader.chunks().clone(),
            damage: reader.damage().to_vec(),
            was_cut_short: reader.was_cut_short(),
            has_frames: reader.has_frames(),
            is_thinned: !Digests::attached(reader.attachments()).is_empty(),
            motion_ns,
        })
    }

    /// When the sample of the motion's first cycle was taken, ns; none without a motion.
    pub(crate) fn motion_ns(&self) -> Option<u64> {
        self.motion_ns
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
        match self.damage.as_slice() {
            [] => true,
            [tail] => self.was_cut_short && tail.to == self.size,
            _ => false,
        }
    }

    /// The exit code of a verb that read this recording.
    pub(crate) fn exit(&self) -> Exit {
        if self.unreadable() + self.undefined > 0 || !self.is_undamaged_to_its_end() {
            Exit::Usage
        } else if self.was_cut_short || self.incomplete_topics().next().is_some() {
            Exit::Incomplete
        } else {
            Exit::Passed
        }
    }

    /// A summary of the contents.
    pub(super) fn info(&self) -> Result<String, Error> {
        let mut text = String::new();
        let chunks = &self.chunks;
        let compression = if chunks.compression.is_empty() { "no compression" } else { &chunks.compression };
        writeln!(
            text,
            "{} bytes; {}, {compression}, {:.2} of their {} bytes",
            self.size,
            counted(chunks.count, "chunk"),
            chunks.compressed_bytes as f64 / chunks.uncompressed_bytes.max(1) as f64,
            chunks.uncompressed_bytes,
        )?;
        if let Some(cycles) = self.cycles() {
            writeln!(
                text,
                "{}, {:.0} bytes a cycle",
                counted(cycles, "cycle"),
                self.size as f64 / cycles as f64
            )?;
        }
        writeln!(text, "{:<8} {:>9} {:>10} {:>10}  schema", "topic", "messages", "Hz", "bytes each")?;
        for (channel, figures) in &self.channels {
            let seconds = (figures.last_ns - figures.first_ns) as f64 / 1e9;
            writeln!(
                text,
                "{:<8} {:>9} {:>10} {:>10.0}  {} ({})",
                channel.topic,
                figures.messages,
                rate(figures.messages, seconds),
                figures.bytes as f64 / figures.messages.max(1) as f64,
                channel.schema.as_ref().map_or("no schema", |schema| &schema.name),
                channel.message_encoding,
            )?;
        }
        if !self.has_frames {
            writeln!(text, "{:<8} not recorded (recording.frames = false)", "frames")?;
        }
        for (name, bytes) in &self.attachments {
            writeln!(text, "attached: {name}, {}", counted(*bytes as u64, "byte"))?;
        }
        let from_ns = self.times().map(|(first, _)| first).min().unwrap_or(0);
        let to_ns = self.times().map(|(_, last)| last).max().unwrap_or(0);
        writeln!(text, "recorded from {from_ns} to {to_ns} ns, {:.3} s", (to_ns - from_ns) as f64 / 1e9)?;
        Ok(text + &self.loss_with_advice()?)
    }

    fn times(&self) -> impl Iterator<Item = (u64, u64)> {
        let received = self.channels.iter().filter(|(_, figures)| figures.messages > 0);
        received.map(|(_, figures)| (figures.first_ns, figures.last_ns))
    }

    /// Recorded cycles: the controller publishes one state in each.
    fn cycles(&self) -> Option<u64> {
        let (_, states) = self.channels.iter().find(|(channel, _)| channel.topic == "state")?;
        (states.messages > 0).then_some(states.messages)
    }

    /// The result of every check.
    pub(super) fn verification(&self) -> Result<String, Error> {
        let mut text = String::new();
        for topic in &self.sequences {
            let TopicFigures { topic, messages, missing } = topic;
            let mark = mark(if self.is_thinned { 0 } else { *missing });
            let between = if self.is_thinned { "left out" } else { "missing" };
            writeln!(
                text,
                "{mark} {topic:<8} {:>18}, {missing} {between} between them",
                counted(*messages, "message")
            )?;
        }
        if !self.has_frames {
            writeln!(text, "–    {:<8} {:>18}", "frame", "not recorded")?;
        }
        let Chunks { count, damaged, .. } = self.chunks;
        writeln!(text, "{} chunks with their checksum: {count}, without: {damaged}", mark(damaged))?;
        let unreadable: u64 = self.damage.iter().map(|damage| damage.to - damage.from).sum();
        writeln!(text, "{} {unreadable} of {} bytes cannot be read", mark(unreadable), self.size)?;
        let end = if self.was_cut_short { "lacks" } else { "has" };
        writeln!(text, "{} the file {end} its end", mark(self.was_cut_short.into()))?;
        Ok(text + &self.loss_with_advice()?)
    }

    /// What is thinned, missing or unreadable, and what helps; empty for a complete recording.
    pub(crate) fn loss_with_advice(&self) -> Result<String, Error> {
        let mut text = self.loss()?;
        if self.was_cut_short {
            writeln!(text, "'masseter recording recover' writes a file with an end")?;
        }
        Ok(text)
    }

    /// What is thinned, missing or unreadable, and where.
    pub(super) fn loss(&self) -> Result<String, Error> {
        let mut text = String::new();
        if self.is_thinned {
            writeln!(text, "thinned: it keeps few messages, and the digests of all")?;
        }
        for damage in &self.damage {
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
            writeln!(
                text,
                "unreadable: {} without a definition of the channel",
                counted(self.undefined, "message")
            )?;
        }
        if self.was_cut_short {
            writeln!(text, "the file lacks its end")?;
        }
        Ok(text)
    }
}

/// The marks of lines.
pub(super) const TONES: [(&str, Tone); 2] = [("ok", Tone::Good), ("FAIL", Tone::Bad)];

/// The mark of a line with so many faults.
fn mark(faults: u64) -> &'static str {
    if faults == 0 { "ok  " } else { "FAIL" }
}

fn rate(messages: u64, seconds: f64) -> String {
    if messages < 2 || seconds <= 0.0 {
        return "–".to_owned();
    }
    format!("{:.1}", (messages - 1) as f64 / seconds)
}

impl ChannelFigures {
    fn add(&mut self, entry: &Entry) {
        if self.messages == 0 {
            self.first_ns = entry.header.log_time;
        }
        self.first_ns = self.first_ns.min(entry.header.log_time);
        self.last_ns = self.last_ns.max(entry.header.log_time);
        self.messages += 1;
        self.bytes += entry.data.len() as u64;
        let unread = entry.recorded().and_then(Result::err).or(entry.frames().and_then(Result::err));
        if let Some(error) = unread {
            self.unreadable += 1;
            self.reason.get_or_insert_with(|| error.to_string());
        }
    }
}
