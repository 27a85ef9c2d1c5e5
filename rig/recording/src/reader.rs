//! Reads a recording from its beginning, also one that was cut short or damaged: every whole chunk is
//! read, and every stretch that cannot be read is reported with its place.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::path::Path;
use std::sync::Arc;
use std::vec;

use masseter_runtime::messages::{FrameTap, LAYOUT_VERSION};
use masseter_scenario::input::open_regular;
use mcap::Attachment;
use mcap::records::{AttachmentHeader, MessageHeader, Record, op};

use super::chunk;
use super::definitions::Definitions;
use super::encapsulation::CDR_LITTLE_ENDIAN;
use super::frames::{self, FrameBatch};
use super::manifest::{AT_START, Manifest};
use super::topic::{Recorded, Stamps, Topic};
use super::walk::{Damage, Step, Walk};

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("cannot read the recording: {0}")]
    File(#[from] io::Error),
    /// Nothing in it is MCAP.
    #[error("not readable as MCAP: {} bytes without a single whole record; {}", .size, .first)]
    NoMcap {
        /// Bytes of the file.
        size: u64,
        /// The first thing wrong with it.
        first: String,
    },
    /// A topic's message does not have this version's layout.
    #[error(
        "topic '{topic}' has a message of {found} bytes, layout version {version}, which is none of this build (version \
         {LAYOUT_VERSION}): read the recording with the masseter that made it; circumstances.json names its version"
    )]
    Foreign {
        /// The topic.
        topic: &'static str,
        /// Bytes found.
        found: usize,
        /// Layout version found.
        version: u64,
    },
}

/// A message with its channel, number and times.
#[derive(Debug)]
pub struct Entry {
    /// Its channel; none when the definition of that channel is lost.
    pub channel: Option<Arc<mcap::Channel<'static>>>,
    /// Its number and times.
    pub header: MessageHeader,
    /// Its bytes as recorded.
    pub data: Vec<u8>,
}

/// How the messages are packed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Chunks {
    /// Chunks whose checksum agreed.
    pub count: u64,
    /// Chunks that could not be unpacked, or whose checksum did not agree.
    pub damaged: u64,
    /// Bytes of their content.
    pub uncompressed_bytes: u64,
    /// Bytes in the file.
    pub compressed_bytes: u64,
    /// Compression of the last one; empty for none.
    pub compression: String,
}

/// Reads a recording, message by message.
///
/// ```no_run
/// use masseter_recording::{Reader, Recorded};
///
/// let mut reader = Reader::open("runs/latest/recording.mcap".as_ref())?;
/// while let Some(message) = reader.next_message()? {
///     if let Recorded::State(state) = message {
///         println!("cycle {}: {:?} m", state.cycle, state.estimated_position_m);
///     }
/// }
/// for damage in reader.damage() {
///     eprintln!("{damage}");
/// }
/// # Ok::<(), masseter_recording::ReadError>(())
/// ```
pub struct Reader<R = BufReader<File>> {
    walk: Walk<R>,
    /// The rest of the current chunk.
    unpacked: vec::IntoIter<Record<'static>>,
    /// The rest of the frames of the current message.
    frames: vec::IntoIter<FrameTap>,
    definitions: Definitions,
    attachments: Vec<Attachment<'static>>,
    chunks: Chunks,
    damage: Vec<Damage>,
    records: u64,
    /// Whether the index was searched for lost definitions.
    index_is_known: bool,
}

impl Reader {
    /// Opens a recording.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::new(BufReader::with_capacity(1 << 18, open_regular(path)?))
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads a recording from `source`.
    pub fn new(source: R) -> Result<Self, ReadError> {
        Ok(Self {
            walk: Walk::new(source)?,
            unpacked: Vec::new().into_iter(),
            frames: Vec::new().into_iter(),
            definitions: Definitions::default(),
            attachments: Vec::new(),
            chunks: Chunks::default(),
            damage: Vec::new(),
            records: 0,
            index_is_known: false,
        })
    }

    /// The stretches that could not be read so far.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// How the messages so far were packed.
    pub fn chunks(&self) -> &Chunks {
        &self.chunks
    }

    /// The channels defined so far, by their id.
    pub fn channels(&self) -> impl Iterator<Item = &mcap::Channel<'static>> {
        self.definitions.channels.values().map(Arc::as_ref)
    }

    /// Whether the definitions so far are those of a recording with CAN frames.
    pub fn has_frames(&self) -> bool {
        self.channels()
            .any(|channel| [FrameBatch::TOPIC, Topic::Frame.name()].contains(&channel.topic.as_str()))
    }

    /// The files attached so far.
    pub fn attachments(&self) -> &[Attachment<'static>] {
        &self.attachments
    }

    /// Whether the files attached so far say that the run was in real time. A recording begins with them.
    pub fn is_in_real_time(&self) -> bool {
        let at_start = self.attachments.iter().find(|file| file.name == AT_START);
        at_start.is_some_and(|file| Manifest::says_real_time(&file.data))
    }

    /// Bytes of the file.
    pub fn size(&self) -> u64 {
        self.walk.size
    }

    /// After the last message: whether the file lacks its end, as a killed recorder leaves it.
    pub fn was_cut_short(&self) -> bool {
        self.walk.end.is_none()
    }

    /// The next message of the rig's topics, or none at the end. Other topics are skipped.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, ReadError> {
        loop {
            if let Some(frame) = self.frames.next() {
                return Ok(Some(Recorded::Frame(frame)));
            }
            let Some(entry) = self.next_entry()? else { return Ok(None) };
            if let Some(message) = entry.recorded() {
                return message.map(Some);
            }
            if let Some(frames) = entry.frames() {
                self.frames = frames?.into_iter();
            }
        }
    }

    /// The next message of any topic, or none at the end.
    pub fn next_entry(&mut self) -> Result<Option<Entry>, ReadError> {
        loop {
            match self.unpacked.next() {
                Some(Record::Message { header, data }) => {
                    let channel = self.definitions.channels.get(&header.channel_id).cloned();
                    return Ok(Some(Entry { channel, header, data: data.into_owned() }));
                }
                Some(record) => self.definitions.take(record),
                None if self.step()? => {}
                None => return Ok(None),
            }
        }
    }

    /// Damage that follows right behind other damage is part of it.
    fn add(&mut self, damage: Damage) {
        match self.damage.last_mut() {
            Some(last) if last.to == damage.from => last.to = damage.to,
            _ => self.damage.push(damage),
        }
    }

    /// Takes the next record of the file. False at the end.
    fn step(&mut self) -> Result<bool, ReadError> {
        match self.walk.step()? {
            Step::End if self.records == 0 => return Err(self.no_mcap()),
            Step::End => return Ok(false),
            Step::Damage(damage) => self.skip(damage)?,
            Step::Record(opcode) => {
                self.records += 1;
                match opcode {
                    op::CHUNK => self.open_chunk()?,
                    op::ATTACHMENT => self.take_attachment(),
                    // Damage can turn other records into messages, and no checksum covers a single record.
                    op::MESSAGE => {
                        let reason = "messages outside of chunks ('mcap compress' packs them)";
                        let damage = self.walk.damaged(reason.to_owned());
                        self.add(damage);
                    }
                    // No message follows, and only the footer's checksum reveals damage here.
                    _ if self.walk.is_in_index => {}
                    _ => self.definitions.parse(opcode, self.walk.body()),
                }
            }
        }
        Ok(true)
    }

    /// Unpacks a chunk and checks it as a whole; a damaged one is skipped.
    fn open_chunk(&mut self) -> Result<(), ReadError> {
        let header = mcap::parse_record(op::CHUNK, self.walk.body());
        match header.and_then(|header| Ok((header, chunk::unpack(&self.walk.record)?))) {
            Ok((Record::Chunk { header, .. }, (records, bytes))) => {
                self.chunks.count += 1;
                self.chunks.uncompressed_bytes += bytes;
                self.chunks.compressed_bytes += header.compressed_size;
                self.chunks.compression = header.compression;
                self.unpacked = records.into_iter();
                Ok(())
            }
            Ok(_) => unreachable!("the opcode is a chunk's"),
            Err(error) => {
                self.chunks.damaged += 1;
                let damage = self.walk.damaged(format!("a chunk that cannot be unpacked ({error})"));
                self.skip(damage)
            }
        }
    }

    /// Takes an attached file, if its checksum agrees.
    fn take_attachment(&mut self) {
        let body = self.walk.body();
        if let Ok(Record::Attachment { header, data, crc }) = mcap::parse_record(op::ATTACHMENT, body)
            && (crc == 0 || crc32fast::hash(&body[..body.len() - 4]) == crc)
        {
            let AttachmentHeader { log_time, create_time, name, media_type } = header;
            let data = Cow::Owned(data.into_owned());
            self.attachments.push(Attachment { log_time, create_time, name, media_type, data });
        } else {
            let damage = self.walk.damaged("an attached file that cannot be read".to_owned());
            self.add(damage);
        }
    }

    /// Notes damage. Lost definitions are taken from the index.
    fn skip(&mut self, damage: Damage) -> Result<(), ReadError> {
        self.add(damage);
        if self.definitions.channels.is_empty() && !self.index_is_known {
            self.index_is_known = true;
            self.definitions = Definitions::from_index(self.walk.ahead())?;
            self.walk.go_on()?;
        }
        Ok(())
    }

    fn no_mcap(&self) -> ReadError {
        let first = self.damage.first().map_or_else(|| "it is empty".to_owned(), ToString::to_string);
        ReadError::NoMcap { size: self.walk.size, first }
    }
}

impl Entry {
    /// The message, or why this program cannot read it; none on topics that are not the rig's, and for [frames](Self::frames).
    pub fn recorded(&self) -> Option<Result<Recorded, ReadError>> {
        let topic = Topic::named(&self.channel.as_ref()?.topic)?;
        Some(read(topic, &self.data))
    }

    /// The CAN frames, or why this program cannot read them; none where it holds something else.
    pub fn frames(&self) -> Option<Result<Vec<FrameTap>, ReadError>> {
        (self.channel.as_ref()?.topic == FrameBatch::TOPIC).then(|| read_frames(&self.data))
    }
}

/// The frames of a message, if they have this version's layout.
fn read_frames(data: &[u8]) -> Result<Vec<FrameTap>, ReadError> {
    let body = data.strip_prefix(&CDR_LITTLE_ENDIAN);
    let version = body.and_then(Stamps::read).map_or(0, |stamps| stamps.version);
    let frames = body.filter(|_| version == LAYOUT_VERSION).and_then(frames::frames);
    frames.ok_or(ReadError::Foreign { topic: FrameBatch::TOPIC, found: data.len(), version })
}

/// The message of a topic behind the CDR header, if it has this version's layout.
fn read(topic: Topic, data: &[u8]) -> Result<Recorded, ReadError> {
    let body = data.strip_prefix(&CDR_LITTLE_ENDIAN);
    let version = body.and_then(Stamps::read).map_or(0, |stamps| stamps.version);
    let message = body.filter(|_| version == LAYOUT_VERSION).and_then(|body| Recorded::read(topic, body));
    message.ok_or_else(|| ReadError::Foreign { topic: topic.name(), found: data.len(), version })
}
