//! Reads a recording from its beginning in constant memory, also one that was cut short.

use std::collections::HashMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use masseter_shared::messages::{Command, Event, FrameTap, LAYOUT_VERSION, Message, Reading, State, Truth};
use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{CDR_LITTLE_ENDIAN, Recorded};

/// A record longer than this is taken for damage, bytes: chunks stay far below.
const LONGEST_RECORD: usize = 64 << 20;

/// Why a recording cannot be read, or not further.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("cannot read the recording: {0}")]
    File(#[from] io::Error),
    /// It is no MCAP file, or damaged at this place.
    #[error("not readable as MCAP after {messages} messages: {error}")]
    Damaged {
        /// Messages read before.
        messages: u64,
        /// What the MCAP reader found.
        error: McapError,
    },
    /// A topic's message does not have this version's layout.
    #[error(
        "topic '{topic}' holds messages of {found} bytes, layout version {version}; \
         this program reads {expected} bytes, version {LAYOUT_VERSION}"
    )]
    Foreign {
        /// The topic.
        topic: String,
        /// Bytes found.
        found: usize,
        /// Bytes expected.
        expected: usize,
        /// Layout version found.
        version: u64,
    },
}

/// A recording being read.
pub struct Reader {
    file: BufReader<File>,
    mcap: LinearReader,
    topics: HashMap<u16, String>,
    messages: u64,
    cut_short: bool,
}

impl Reader {
    /// Opens a recording.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let options = LinearReaderOptions::default()
            .with_skip_end_magic(true)
            .with_prevalidate_chunk_crcs(true)
            .with_record_length_limit(LONGEST_RECORD);
        Ok(Self {
            file: BufReader::with_capacity(1 << 20, File::open(path)?),
            mcap: LinearReader::new_with_options(options),
            topics: HashMap::new(),
            messages: 0,
            cut_short: false,
        })
    }

    /// Whether the file ended in the middle of a record, as a killed logger leaves it.
    pub fn was_cut_short(&self) -> bool {
        self.cut_short
    }

    /// The next message, or none at the end. Topics this program does not know are passed over.
    pub fn next_message(&mut self) -> Result<Option<Recorded>, ReadError> {
        loop {
            match self.mcap.next_event() {
                None => return Ok(None),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let read = self.file.read(self.mcap.insert(wanted))?;
                    self.mcap.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { data, opcode })) => {
                    let record = mcap::parse_record(opcode, data)
                        .map_err(|error| ReadError::Damaged { messages: self.messages, error })?;
                    match record {
                        Record::Channel(channel) => {
                            self.topics.insert(channel.id, channel.topic);
                        }
                        Record::Message { header, data } => {
                            let topic = self.topics.get(&header.channel_id).map_or("", String::as_str);
                            if let Some(message) = decode(topic, &data)? {
                                self.messages += 1;
                                return Ok(Some(message));
                            }
                        }
                        _ => {}
                    }
                }
                Some(Err(McapError::UnexpectedEof)) => {
                    self.cut_short = true;
                    return Ok(None);
                }
                Some(Err(error)) => return Err(ReadError::Damaged { messages: self.messages, error }),
            }
        }
    }
}

fn decode(topic: &str, data: &[u8]) -> Result<Option<Recorded>, ReadError> {
    let recorded = match topic {
        Command::TOPIC => Recorded::Command(body(data)?),
        Reading::TOPIC => Recorded::Reading(body(data)?),
        State::TOPIC => Recorded::State(body(data)?),
        Truth::TOPIC => Recorded::Truth(body(data)?),
        FrameTap::TOPIC => Recorded::Frame(body(data)?),
        Event::TOPIC => Recorded::Event(body(data)?),
        _ => return Ok(None),
    };
    Ok(Some(recorded))
}

/// The message behind the CDR header, if it has this version's layout.
fn body<M: Message>(data: &[u8]) -> Result<M, ReadError> {
    let expected = CDR_LITTLE_ENDIAN.len() + size_of::<M>();
    let version = data.get(20..28).map_or(0, |bytes| u64::from_le_bytes(bytes.try_into().expect("8 bytes")));
    let fits = data.len() == expected && data.starts_with(&CDR_LITTLE_ENDIAN) && version == LAYOUT_VERSION;
    if !fits {
        return Err(ReadError::Foreign { topic: M::TOPIC.to_owned(), found: data.len(), expected, version });
    }
    Ok(bytemuck::pod_read_unaligned(&data[CDR_LITTLE_ENDIAN.len()..]))
}
