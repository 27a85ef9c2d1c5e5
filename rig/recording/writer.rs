//! Writes a recording: zstd chunks with checksums, complete up to the last [`Recorder::flush`]
//! whatever happens afterwards.
//!
//! It waits for its medium; a process that must not wait records through a
//! [`Backlog`](super::Backlog).

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};

use foxglove::Encode;
use masseter_shared::messages::{Command, Event, FrameTap, Message, Reading, State, Truth};
use mcap::records::MessageHeader;
use mcap::{Compression, McapError, WriteOptions, Writer};

use super::scene::Scene;
use super::topic::{Stamps, Topic};
use super::{CDR_LITTLE_ENDIAN, MESSAGE_ENCODING, SCHEMA_ENCODING};

/// Bytes of messages in a chunk: what is compressed together, and read together by a tool that seeks.
const CHUNK_BYTES: u64 = 1 << 20;
/// zstd's fastest level: its ratio on these messages is within a tenth of the default level's.
const COMPRESSION_LEVEL: u32 = 1;
/// Bytes gathered before they go to the system.
const BUFFER_BYTES: usize = 1 << 18;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file could not be created.
    #[error("cannot create the recording: {0}")]
    Create(#[from] io::Error),
    /// Writing failed.
    #[error("cannot write the recording: {0}")]
    Write(#[from] McapError),
    /// A message could not be put into a Foxglove schema.
    #[error("cannot encode the scene: {0}")]
    Scene(String),
}

/// How recordings are laid out: the options of every MCAP file that Masseter writes.
pub(super) fn options() -> WriteOptions {
    // One thread compresses, so that the same messages give the same bytes; chunks go out whole, so that a
    // file cut at any byte loses no more than the last of them.
    WriteOptions::new()
        .compression(Some(Compression::Zstd))
        .compression_level(COMPRESSION_LEVEL)
        .compression_threads(0)
        .chunk_size(Some(CHUNK_BYTES))
        .disable_seeking(true)
        .library(concat!("masseter ", env!("CARGO_PKG_VERSION")))
}

/// An open recording on `W`.
pub struct Recorder<W: Write + Seek = DurableFile> {
    writer: Writer<W>,
    channels: BTreeMap<&'static str, u16>,
    scene: Scene,
    bytes: Vec<u8>,
}

impl Recorder {
    /// Creates the file, which must not exist.
    pub fn create(path: &Path, scene: Scene) -> Result<Self, WriteError> {
        Self::on(DurableFile::create(path)?, scene)
    }
}

impl<W: Write + Seek> Recorder<W> {
    /// Begins a recording, with a channel a topic. The definitions are flushed at once: without them no
    /// message can be read.
    pub fn on(medium: W, scene: Scene) -> Result<Self, WriteError> {
        let mut recorder =
            Self { writer: options().create(medium)?, channels: BTreeMap::new(), scene, bytes: Vec::new() };
        recorder.add_topic::<Command>()?;
        recorder.add_topic::<Reading>()?;
        recorder.add_topic::<State>()?;
        recorder.add_topic::<Truth>()?;
        recorder.add_topic::<FrameTap>()?;
        recorder.add_topic::<Event>()?;
        recorder.add_foxglove::<foxglove::messages::FrameTransforms>(Scene::TRANSFORMS)?;
        recorder.add_foxglove::<foxglove::messages::SceneUpdate>(Scene::ENTITIES)?;
        recorder.flush()?;
        Ok(recorder)
    }

    fn add_topic<M: Message>(&mut self) -> Result<(), WriteError> {
        let schema = self.writer.add_schema(M::TYPE_NAME, SCHEMA_ENCODING, M::schema().as_bytes())?;
        let channel = self.writer.add_channel(schema, M::TOPIC, MESSAGE_ENCODING, &BTreeMap::new())?;
        self.channels.insert(M::TOPIC, channel);
        Ok(())
    }

    fn add_foxglove<E: Encode>(&mut self, topic: &'static str) -> Result<(), WriteError> {
        let schema = E::get_schema().expect("Foxglove's own messages have schemas");
        let schema = self.writer.add_schema(&schema.name, &schema.encoding, &schema.data)?;
        let channel = self.writer.add_channel(schema, topic, &E::get_message_encoding(), &BTreeMap::new())?;
        self.channels.insert(topic, channel);
        Ok(())
    }

    /// Appends a message that was received at `log_time_ns`, and what a 3-D view shows of it.
    pub fn record<M: Message>(&mut self, message: &M, log_time_ns: u64) -> Result<(), WriteError> {
        self.record_body(Topic::of::<M>(), bytemuck::bytes_of(message), log_time_ns)
    }

    /// Appends the message of a topic that lies in `body`, and what a 3-D view shows of it.
    pub(super) fn record_body(
        &mut self,
        topic: Topic,
        body: &[u8],
        log_time_ns: u64,
    ) -> Result<(), WriteError> {
        self.bytes.clear();
        self.bytes.extend_from_slice(&CDR_LITTLE_ENDIAN);
        self.bytes.extend_from_slice(body);
        let stamps = Stamps::read(body).expect("every message begins with its stamps");
        self.write(topic.name(), stamps.seq as u32, log_time_ns, stamps.published_ns)?;
        self.show(topic, body, log_time_ns)
    }

    /// Lets the scene follow the mechanism.
    fn show(&mut self, topic: Topic, body: &[u8], log_time_ns: u64) -> Result<(), WriteError> {
        let shown = match topic {
            Topic::State => self.scene.state(&bytemuck::pod_read_unaligned(body)),
            Topic::Truth => self.scene.truth(&bytemuck::pod_read_unaligned(body)),
            _ => return Ok(()),
        };
        let Some(shown) = shown else { return Ok(()) };
        self.write_foxglove(Scene::TRANSFORMS, &shown.transforms, log_time_ns, shown.time_ns)?;
        match &shown.entities {
            Some(entities) => self.write_foxglove(Scene::ENTITIES, entities, log_time_ns, shown.time_ns),
            None => Ok(()),
        }
    }

    fn write_foxglove<E: Encode>(
        &mut self,
        topic: &'static str,
        message: &E,
        log_time_ns: u64,
        time_ns: u64,
    ) -> Result<(), WriteError> {
        self.bytes.clear();
        message.encode(&mut self.bytes).map_err(|error| WriteError::Scene(error.to_string()))?;
        self.write(topic, 0, log_time_ns, time_ns)
    }

    /// Writes what stands in `self.bytes`.
    fn write(
        &mut self,
        topic: &'static str,
        sequence: u32,
        log_time: u64,
        publish_time: u64,
    ) -> Result<(), WriteError> {
        let header = MessageHeader { channel_id: self.channels[topic], sequence, log_time, publish_time };
        Ok(self.writer.write_to_known_channel(&header, &self.bytes)?)
    }

    /// Ends the chunk and hands everything recorded so far to the medium.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        Ok(self.writer.flush()?)
    }

    /// Ends the file with its index.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.writer.finish()?;
        Ok(self.writer.into_inner().flush().map_err(McapError::from)?)
    }
}

/// A file whose flush reaches the system at once and the disk soon after: what was flushed survives the
/// death of the process, and, once the disk has taken it, a power cut.
///
/// A thread of its own waits for the disk, so that a slow one does not hold the writer up. Dropping the file
/// waits for the last of it.
#[derive(Debug)]
pub struct DurableFile {
    file: BufWriter<File>,
    wanted: Option<SyncSender<()>>,
    done: Receiver<io::Result<()>>,
    disk: Option<JoinHandle<()>>,
}

impl DurableFile {
    /// Creates the file, which must not exist, and its entry in the folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create_new(path)?;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            File::open(folder)?.sync_all()?;
        }
        // One request may wait while another is carried out: it covers all that came before it.
        let (wanted, requests) = sync_channel(1);
        let (report, done) = channel();
        let for_disk = file.try_clone()?;
        let disk = thread::spawn(move || {
            for () in requests {
                // Nobody listens any more when the file is being dropped.
                let _ = report.send(for_disk.sync_data());
            }
        });
        let file = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(Self { file, wanted: Some(wanted), done, disk: Some(disk) })
    }
}

impl Drop for DurableFile {
    fn drop(&mut self) {
        self.wanted = None;
        if let Some(disk) = self.disk.take() {
            let _ = disk.join();
        }
    }
}

impl Write for DurableFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    /// Also tells of an earlier flush that the disk refused.
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()?;
        for earlier in self.done.try_iter() {
            earlier?;
        }
        if let Some(wanted) = &self.wanted {
            // A request that waits already covers this one too.
            let _ = wanted.try_send(());
        }
        Ok(())
    }
}

impl Seek for DurableFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }

    fn stream_position(&mut self) -> io::Result<u64> {
        self.file.stream_position()
    }
}
