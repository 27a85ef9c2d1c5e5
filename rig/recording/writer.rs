//! Writes a recording. Complete up to the last [`Recorder::flush`], whatever happens afterwards.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use mcap::records::MessageHeader;
use mcap::{WriteOptions, Writer};

use super::{CDR_LITTLE_ENDIAN, MESSAGE_ENCODING, SCHEMA_ENCODING};

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file could not be created.
    #[error("cannot create the recording: {0}")]
    Create(#[from] io::Error),
    /// Writing failed.
    #[error("cannot write the recording: {0}")]
    Write(#[from] mcap::McapError),
}

/// An open recording.
pub struct Recorder {
    writer: Writer<BufWriter<File>>,
    channels: BTreeMap<&'static str, u16>,
    bytes: Vec<u8>,
}

impl Recorder {
    /// Creates the file, with a channel a topic.
    pub fn create(path: &Path) -> Result<Self, WriteError> {
        let file = BufWriter::with_capacity(1 << 20, File::create_new(path)?);
        let writer = WriteOptions::new()
            .compression(None)
            .library(concat!("masseter ", env!("CARGO_PKG_VERSION")))
            .create(file)?;
        let mut recorder = Self { writer, channels: BTreeMap::new(), bytes: Vec::new() };
        recorder.add_topic::<Command>()?;
        recorder.add_topic::<Reading>()?;
        recorder.add_topic::<State>()?;
        recorder.add_topic::<Truth>()?;
        recorder.add_topic::<FrameTap>()?;
        recorder.add_topic::<Event>()?;
        Ok(recorder)
    }

    fn add_topic<M: Message>(&mut self) -> Result<(), WriteError> {
        let schema = self.writer.add_schema(M::TYPE_NAME, SCHEMA_ENCODING, M::schema().as_bytes())?;
        let channel = self.writer.add_channel(schema, M::TOPIC, MESSAGE_ENCODING, &BTreeMap::new())?;
        self.channels.insert(M::TOPIC, channel);
        Ok(())
    }

    /// Appends a message that was received at `log_time_ns`.
    pub fn record<M: Message>(&mut self, message: &M, log_time_ns: u64) -> Result<(), WriteError> {
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        self.bytes.extend_from_slice(bytemuck::bytes_of(message));
        let header = MessageHeader {
            channel_id: self.channels[M::TOPIC],
            sequence: message.seq() as u32,
            log_time: log_time_ns,
            publish_time: message.published_ns(),
        };
        Ok(self.writer.write_to_known_channel(&header, &self.bytes)?)
    }

    /// Hands everything recorded so far to the system.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.writer.flush()?)
    }

    /// Ends the file with its index.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.writer.finish()?;
        Ok(())
    }
}
