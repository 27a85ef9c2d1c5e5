//! Reads a recording from its beginning, also one that was cut short or damaged: every whole chunk is
//! read, and every stretch that cannot be read is reported with its place.

use std::io::{self, BufReader, Read, Seek};
use std::{borrow::Cow, collections::BTreeMap, fs::File, path::Path, sync::Arc, vec};

use masseter_runtime::messages::LAYOUT_VERSION;
use mcap::records::{AttachmentHeader, MessageHeader, Record, SchemaHeader, op};
use mcap::{Attachment, Channel, Schema};

use crate::encoding::{FrameBatch, frames_of};
use crate::topic::{CDR_LITTLE_ENDIAN, Recorded, Stamps, Topic};
use crate::walk::{Damage, Step, Walk, unpack_chunk};

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
        "topic '{topic}' has a message of {found} bytes, layout version {version}, which is not that of this build (version \
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
    pub channel: Option<Arc<Channel<'static>>>,
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
    /// The rest of the current entry.
    messages: vec::IntoIter<Recorded>,
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
        Self::new(BufReader::with_capacity(1 << 18, masseter_scenario::input::open_regular(path)?))
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads a recording from `source`.
    pub fn new(source: R) -> Result<Self, ReadError> {
        Ok(Self {
            walk: Walk::new(source)?,
            unpacked: Vec::new().into_iter(),
            messages: Vec::new().into_iter(),
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
    pub fn channels(&self) -> impl Iterator<Item = &Channel<'static>> {
        self.definitions.channels.values().map(Arc::as_ref)
    }

    /// Whether the definitions so far are those of a recording with CAN frames.
    pub fn has_frames(&self) -> bool {
        let names = [FrameBatch::TOPIC, Topic::Frame.name()];
        self.channels().any(|channel| names.contains(&channel.topic.as_str()))
    }

    /// The files attached so far.
    pub fn attachments(&self) -> &[Attachment<'static>] {
        &self.attachments
    }

    /// Whether the files attached so far say that the run was in real time. A recording begins with them.
    pub fn is_in_real_time(&self) -> bool {
        let at_start = self.attachments.iter().find(|file| file.name == crate::manifest::AT_START);
        at_start.is_some_and(|file| crate::manifest::Manifest::says_real_time(&file.data))
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
            if let Some(message) = self.messages.next() {
                return Ok(Some(message));
            }
            let Some(entry) = self.next_entry()? else { return Ok(None) };
            self.messages = entry.messages()?.into_iter();
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
                Some(record) => self.definitions.add_definition(record),
                None if self.read_record()? => {}
                None => return Ok(None),
            }
        }
    }

    /// Damage that follows right behind other damage is part of it.
    fn note_damage(&mut self, damage: Damage) {
        match self.damage.last_mut() {
            Some(last) if last.to == damage.from => last.to = damage.to,
            _ => self.damage.push(damage),
        }
    }

    /// Notes that the current record is damaged.
    fn note_record(&mut self, reason: &str) {
        let damage = self.walk.damaged(reason.to_owned());
        self.note_damage(damage);
    }

    /// Takes the next record of the file. False at the end.
    fn read_record(&mut self) -> Result<bool, ReadError> {
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
                        self.note_record("messages outside of chunks ('mcap compress' packs them)");
                    }
                    // No message follows, and only the footer's checksum reveals damage here.
                    _ if self.walk.is_in_index => {}
                    _ => self.definitions.parse_definition(opcode, self.walk.body()),
                }
            }
        }
        Ok(true)
    }

    /// Unpacks a chunk and checks it as a whole; a damaged one is skipped.
    fn open_chunk(&mut self) -> Result<(), ReadError> {
        let header = mcap::parse_record(op::CHUNK, self.walk.body());
        match header.and_then(|header| Ok((header, unpack_chunk(&self.walk.record)?))) {
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
        if let Ok(Record::Attachment { header, data, .. }) = mcap::parse_record(op::ATTACHMENT, body) {
            let AttachmentHeader { log_time, create_time, name, media_type } = header;
            let data = Cow::Owned(data.into_owned());
            self.attachments.push(Attachment { log_time, create_time, name, media_type, data });
        } else {
            self.note_record("an attached file that cannot be read");
        }
    }

    /// Notes damage. Lost definitions are taken from the index.
    fn skip(&mut self, damage: Damage) -> Result<(), ReadError> {
        self.note_damage(damage);
        if self.definitions.channels.is_empty() && !self.index_is_known {
            self.index_is_known = true;
            self.definitions = Definitions::from_index(self.walk.ahead())?;
            self.walk.seek_next()?;
        }
        Ok(())
    }

    fn no_mcap(&self) -> ReadError {
        let first = self.damage.first().map_or_else(|| "it is empty".to_owned(), ToString::to_string);
        ReadError::NoMcap { size: self.walk.size, first }
    }
}

/// The definitions of channels, which the beginning of a recording holds, and its index again.
#[derive(Debug, Default)]
struct Definitions {
    schemas: BTreeMap<u16, Arc<Schema<'static>>>,
    channels: BTreeMap<u16, Arc<Channel<'static>>>,
}

impl Definitions {
    /// Those in the index behind the place of `walk`. Only the checksum in the footer covers them, so either all or none
    /// are taken.
    fn from_index<R: Read + Seek>(mut walk: Walk<R>) -> io::Result<Self> {
        let mut found = Self::default();
        loop {
            match walk.step()? {
                Step::Record(op::FOOTER) => return Ok(found),
                Step::Record(opcode) if walk.is_in_index => found.parse_definition(opcode, walk.body()),
                Step::Record(_) => {}
                Step::Damage(_) => found = Self::default(),
                Step::End => return Ok(Self::default()),
            }
        }
    }

    /// Takes a schema or a channel; a damaged one counts as missing.
    fn parse_definition(&mut self, opcode: u8, body: &[u8]) {
        if let (op::SCHEMA | op::CHANNEL, Ok(record)) = (opcode, mcap::parse_record(opcode, body)) {
            self.add_definition(record.into_owned());
        }
    }

    /// Takes a record, if it is a schema or a channel.
    fn add_definition(&mut self, record: Record<'static>) {
        match record {
            Record::Schema { header: SchemaHeader { id, name, encoding }, data } => {
                let data = Cow::Owned(data.into_owned());
                self.schemas.insert(id, Arc::new(Schema { id, name, encoding, data }));
            }
            Record::Channel(mcap::records::Channel { id, schema_id, topic, message_encoding, metadata }) => {
                let schema = self.schemas.get(&schema_id).cloned();
                let channel = Channel { id, topic, schema, message_encoding, metadata };
                self.channels.insert(id, Arc::new(channel));
            }
            _ => {}
        }
    }
}

impl Entry {
    /// The messages of the rig in it: one, several CAN frames, or none on topics that are not the rig's.
    ///
    /// # Errors
    /// [`ReadError::Foreign`] for another layout.
    pub fn messages(&self) -> Result<Vec<Recorded>, ReadError> {
        let topic = self.channel.as_ref().map_or("", |channel| &channel.topic);
        if topic == FrameBatch::TOPIC {
            let frames = decoded(FrameBatch::TOPIC, &self.data, frames_of)?;
            return Ok(frames.into_iter().map(Recorded::Frame).collect());
        }
        let message = |topic: Topic| decoded(topic.name(), &self.data, |body| Recorded::read(topic, body));
        Topic::named(topic).map(message).into_iter().collect()
    }
}

/// What a message of a topic holds behind the CDR header, if it has this version's layout.
fn decoded<T>(
    topic: &'static str,
    data: &[u8],
    read: impl FnOnce(&[u8]) -> Option<T>,
) -> Result<T, ReadError> {
    let body = data.strip_prefix(&CDR_LITTLE_ENDIAN);
    let version = body.and_then(Stamps::read).map_or(0, |stamps| stamps.version);
    let found = body.filter(|_| version == LAYOUT_VERSION).and_then(read);
    found.ok_or(ReadError::Foreign { topic, found: data.len(), version })
}
