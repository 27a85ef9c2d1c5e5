//! Reads a recording from its beginning in constant memory, also one that was cut short or damaged:
//! what can be read is read, and what cannot is named by its place.

use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek};
use std::ops::Range;
use std::path::Path;

use masseter_shared::messages::LAYOUT_VERSION;
use mcap::records::{Channel, MessageHeader, Record, op};

use super::chunk::Chunk;
use super::definitions::{Definitions, Schema};
use super::topic::{Stamps, Topic};
use super::walk::{Damage, Step, Walk};
use super::writer::LIBRARY;
use super::{CDR_LITTLE_ENDIAN, Recorded};

/// Channel, sequence number and two times, before the data.
const MESSAGE_HEAD: usize = 2 + 4 + 8 + 8;

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
        "topic '{topic}' holds a message of {found} bytes, layout version {version}; \
         this program reads up to {expected} bytes, version {LAYOUT_VERSION}"
    )]
    Foreign {
        /// The topic.
        topic: &'static str,
        /// Bytes found.
        found: usize,
        /// Bytes of the longest that is read.
        expected: usize,
        /// Layout version found.
        version: u64,
    },
}

/// A message with its circumstances.
#[derive(Debug)]
pub struct Entry<'a> {
    /// The channel it stands on; none when the recording no longer says what that channel is.
    pub channel: Option<&'a Channel>,
    /// The channel's schema, if it has one.
    pub schema: Option<&'a Schema>,
    /// Its number and times.
    pub header: MessageHeader,
    /// Its bytes as recorded.
    pub data: &'a [u8],
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

/// A recording being read.
pub struct Reader<R = BufReader<File>> {
    walk: Walk<R>,
    chunk: Chunk,
    definitions: Definitions,
    chunks: Chunks,
    damage: Vec<Damage>,
    records: u64,
    /// Whether the index has been asked for lost definitions.
    index_is_known: bool,
    /// Whether this version of the program recorded it.
    is_own: bool,
}

impl Reader {
    /// Opens a recording.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        Self::new(BufReader::with_capacity(1 << 18, File::open(path)?))
    }
}

impl<R: Read + Seek> Reader<R> {
    /// Reads a recording from `source`.
    pub fn new(source: R) -> Result<Self, ReadError> {
        Ok(Self {
            walk: Walk::new(source)?,
            chunk: Chunk::default(),
            definitions: Definitions::default(),
            chunks: Chunks::default(),
            damage: Vec::new(),
            records: 0,
            index_is_known: false,
            is_own: false,
        })
    }

    /// What could not be read so far.
    pub fn damage(&self) -> &[Damage] {
        &self.damage
    }

    /// How the messages so far were packed.
    pub fn chunks(&self) -> &Chunks {
        &self.chunks
    }

    /// The channels defined so far, by their id, each with its schema.
    pub fn channels(&self) -> impl Iterator<Item = (&Channel, Option<&Schema>)> {
        self.definitions.channels()
    }

    /// Bytes of the file.
    pub fn size(&self) -> u64 {
        self.walk.size()
    }

    /// At the end: whether the file lacks its own, as a killed recorder leaves it.
    pub fn was_cut_short(&self) -> bool {
        !self.walk.is_closed()
    }

    /// The next message of the rig's topics, or none at the end. Other topics are passed over.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, ReadError> {
        while let Some(entry) = self.next_entry()? {
            if let Some(message) = entry.recorded() {
                return message.map(Some);
            }
        }
        Ok(None)
    }

    /// The next message of whatever topic, or none at the end.
    pub fn next_entry(&mut self) -> Result<Option<Entry<'_>>, ReadError> {
        let Some(message) = self.next_message_bytes()? else { return Ok(None) };
        let Ok(Record::Message { header, data: Cow::Borrowed(data) }) =
            mcap::parse_record(op::MESSAGE, self.chunk.bytes(message))
        else {
            unreachable!("a message with a whole head can be parsed, and borrows");
        };
        let (channel, schema) = self.definitions.of(header.channel_id).unzip();
        Ok(Some(Entry { channel, schema: schema.flatten(), header, data }))
    }

    /// Where in the open chunk the next message lies. Definitions on the way are taken up.
    fn next_message_bytes(&mut self) -> Result<Option<Range<usize>>, ReadError> {
        loop {
            match self.chunk.next_record() {
                Some(Ok((op::MESSAGE, bytes))) if bytes.len() >= MESSAGE_HEAD => return Ok(Some(bytes)),
                Some(Ok((op::MESSAGE, _))) => self.note("a message without a head"),
                Some(Ok((opcode, bytes))) => self.definitions.take(opcode, self.chunk.bytes(bytes)),
                Some(Err(reason)) => self.note(reason),
                None if self.step()? => {}
                None => return Ok(None),
            }
        }
    }

    fn note(&mut self, reason: &str) {
        let damage = self.walk.damaged(reason.to_owned());
        self.add(damage);
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
            Step::Damage(damage) => self.pass_over(damage)?,
            Step::Record(opcode) => {
                self.records += 1;
                match opcode {
                    op::HEADER => self.is_own = is_own(self.walk.body()),
                    op::CHUNK => self.open_chunk()?,
                    // Damage turns other records into such, and no checksum of their own tells.
                    op::MESSAGE => self.note("messages outside of chunks (`mcap compress` packs them)"),
                    // No message comes any more, and what is damaged here is told only by the footer.
                    _ if self.walk.is_in_index() => {}
                    _ => self.definitions.take(opcode, self.walk.body()),
                }
            }
        }
        Ok(true)
    }

    /// Unpacks a chunk and checks it as a whole; one that is damaged is passed over.
    fn open_chunk(&mut self) -> Result<(), ReadError> {
        match self.chunk.open(self.walk.body()) {
            Ok(header) => {
                self.chunks.count += 1;
                self.chunks.uncompressed_bytes += header.uncompressed_size;
                self.chunks.compressed_bytes += header.compressed_size;
                self.chunks.compression = header.compression;
                Ok(())
            }
            Err(error) => {
                self.chunks.damaged += 1;
                let damage = self.walk.damaged(error.to_string());
                self.pass_over(damage)
            }
        }
    }

    /// Notes damage. Definitions that it hit are looked for elsewhere.
    fn pass_over(&mut self, damage: Damage) -> Result<(), ReadError> {
        self.add(damage);
        if self.definitions.is_empty() && !self.index_is_known {
            self.index_is_known = true;
            let place = self.walk.place();
            let found = Definitions::of_index(&mut self.walk)?;
            self.walk.go_to(place)?;
            let is_own = found.is_empty() && self.is_own;
            self.definitions.add(if is_own { Definitions::of_this_version() } else { found });
        }
        Ok(())
    }

    fn no_mcap(&self) -> ReadError {
        let first = self.damage.first().map_or_else(|| "it is empty".to_owned(), ToString::to_string);
        ReadError::NoMcap { size: self.walk.size(), first }
    }
}

impl Entry<'_> {
    /// The message itself, or why this program cannot read it; none on topics that are not the rig's.
    pub fn recorded(&self) -> Option<Result<Recorded, ReadError>> {
        let topic = Topic::named(&self.channel?.topic)?;
        Some(read(topic, self.data))
    }
}

/// Whether this is the header of a recording of this version.
fn is_own(header: &[u8]) -> bool {
    matches!(mcap::parse_record(op::HEADER, header), Ok(Record::Header(header)) if header.library == LIBRARY)
}

/// The message of a topic behind the CDR header, if it has this version's layout.
fn read(topic: Topic, data: &[u8]) -> Result<Recorded, ReadError> {
    let body = data.strip_prefix(&CDR_LITTLE_ENDIAN);
    let version = body.and_then(Stamps::read).map_or(0, |stamps| stamps.version);
    let message = body.filter(|_| version == LAYOUT_VERSION).and_then(|body| topic.read(body));
    message.ok_or_else(|| {
        let expected = CDR_LITTLE_ENDIAN.len() + topic.body_bytes();
        ReadError::Foreign { topic: topic.name(), found: data.len(), expected, version }
    })
}
