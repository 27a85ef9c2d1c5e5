//! Writes a recording: zstd chunks with checksums, complete up to the last [`Recorder::flush`]
//! whatever happens afterwards.
//!
//! It waits for its medium; a process that must not wait records through a
//! [`Backlog`](super::Backlog).

use std::fs::{self, File};
use std::io::{self, BufWriter, Cursor, Seek, Write};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::{borrow::Cow, error::Error, path::Path, thread};

use masseter_runtime::{messages::FrameTap, named::Declared};
use masseter_scenario::input::read_bytes;
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer, records::MessageHeader, write::NoSeek};

use crate::encoding::{Channel, Encoded, Encoder, FrameBatch, definition};
use crate::topic::{Recorded, Topic};
use crate::{folder::RunFolder, scene::Scene};

/// Bytes of messages in a chunk, the unit of compression and of a tool that seeks. Twice as many save 0.4 %.
const CHUNK_BYTES: u64 = 1 << 20;
/// A level of zstd, its default. Level 6 saves 3 % of the bytes for a fifth more CPU time of a run under virtual time; level 1 takes
/// 6 % more bytes for a tenth less time.
const COMPRESSION_LEVEL: u32 = 3;
/// The profile in the header of a recording: its messages have ROS 2's encoding and definitions.
const PROFILE: &str = "ros2";
/// The name of this program in the header of a recording.
const LIBRARY: &str = concat!("masseter ", env!("CARGO_PKG_VERSION"));
/// A file of the scenario with more bytes than this lies beside the recording alone: readers hold attached files in memory.
const LONGEST_FILE: u64 = 16 << 20;
/// Bytes gathered before they go to the system.
const BUFFER_BYTES: usize = 1 << 18;

/// Why a recording cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file could not be created, or an attached file not be read.
    #[error("cannot create the recording: {0}")]
    Create(#[from] io::Error),
    /// Writing failed.
    #[error("cannot write the recording: {}", root_of(.0))]
    Write(#[from] McapError),
}

/// The error at the root of another: the system's own word, where there is one.
fn root_of(error: &dyn Error) -> &dyn Error {
    error.source().map_or(error, root_of)
}

/// The medium of a recording: a file, or memory.
pub trait Medium: Write {
    /// Waits until everything written is safe.
    fn close(self) -> io::Result<()>;
}

impl Medium for &mut Cursor<Vec<u8>> {
    fn close(self) -> io::Result<()> {
        Ok(())
    }
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
        .profile(PROFILE)
        .library(LIBRARY)
}

/// A file to attach. It has no time, since runs in simulated time leave the same bytes whenever they are made.
pub(super) fn timeless<'a>(name: &str, media_type: &str, data: &'a [u8]) -> Attachment<'a> {
    let (name, media_type, data) = (name.to_owned(), media_type.to_owned(), Cow::Borrowed(data));
    Attachment { log_time: 0, create_time: 0, name, media_type, data }
}

/// Adds a channel of another file under its number there.
pub(super) fn copy_channel<W: Write + Seek>(
    writer: &mut Writer<W>,
    channel: &mcap::Channel,
) -> Result<(), McapError> {
    let schema = add_schema(writer, channel)?;
    let mcap::Channel { id, topic, message_encoding, metadata, .. } = channel;
    writer.add_channel_with_id(*id, schema, topic, message_encoding, metadata).map(drop)
}

/// Adds the schema of a channel to a file. Returns its number; 0 means no schema.
fn add_schema<W: Write + Seek>(writer: &mut Writer<W>, channel: &mcap::Channel) -> Result<u16, McapError> {
    match &channel.schema {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data),
        None => Ok(0),
    }
}

/// Writes a recording on `W`.
///
/// ```
/// use std::io::Cursor;
///
/// use masseter_recording::{Reader, Recorded, Recorder, Scene};
/// use masseter_scenario::Scenario;
/// use masseter_model::geometry::Mechanism;
/// use masseter_runtime::messages::{Command, Message};
///
/// let scenario = Scenario::default();
/// let scene = Scene::new(&Mechanism::new(&scenario.mechanism)?, &scenario.jaw);
/// let mut medium = Cursor::new(Vec::new());
/// let mut recorder = Recorder::new(&mut medium, scene)?;
/// let mut command = Command::default();
/// command.stamp(1, 1_000_000);
/// recorder.record(&Recorded::Command(command), 1_000_000)?;
/// recorder.finish()?;
///
/// let mut reader = Reader::new(medium)?;
/// assert_eq!(reader.next_message()?, Some(Recorded::Command(command)));
/// assert_eq!(reader.next_message()?, None);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[doc(alias("logger", "data logger"))]
pub struct Recorder<W: Medium = DurableFile> {
    file: RecordingFile<W>,
    encoder: Encoder,
    /// `None` if the frames are left out.
    frames: Option<FrameBatch>,
}

/// The file with the numbers of its channels, by their places.
struct RecordingFile<W: Medium> {
    writer: Writer<NoSeek<W>>,
    ids: [Option<u16>; Channel::COUNT],
}

impl<W: Medium> RecordingFile<W> {
    fn write_message(&mut self, message: &Encoded, log_time_ns: u64) -> Result<(), WriteError> {
        // Nobody declared what it holds.
        let Some(channel_id) = self.ids[message.channel.place()] else { return Ok(()) };
        let &Encoded { sequence, publish_time_ns: publish_time, .. } = message;
        let header = MessageHeader { channel_id, sequence, log_time: log_time_ns, publish_time };
        Ok(self.writer.write_to_known_channel(&header, message.bytes)?)
    }
}

impl Recorder {
    /// Creates the file, which must not exist.
    pub fn create(path: &Path, scene: Scene) -> Result<Self, WriteError> {
        Self::new(DurableFile::create(path)?, scene)
    }

    /// Creates the recording of a run, with what explains it attached: the scenario, the files that it names, and
    /// the circumstances at the start. A file that is cut short contains them. The scenario says whether it has the CAN frames.
    pub fn of_run(folder: &RunFolder, scene: Scene) -> Result<Self, WriteError> {
        let mut manifest = crate::manifest::Manifest::read(folder)?;
        let frames = manifest.scenario.recording.frames.then(FrameBatch::default);
        let mut recorder = Self::with_frames(DurableFile::create(&folder.recording())?, scene, frames)?;
        let scenario = read_bytes(&folder.scenario(), LONGEST_FILE)?;
        recorder.attach("scenario.toml", "application/toml", &scenario)?;
        for (name, _) in manifest.scenario.files_mut() {
            let path = folder.file(&name);
            if fs::metadata(&path).is_ok_and(|file| file.len() <= LONGEST_FILE) {
                recorder.attach(&name, "text/csv", &read_bytes(&path, LONGEST_FILE)?)?;
            }
        }
        recorder.attach(crate::manifest::AT_START, "application/json", manifest.at_start().as_bytes())?;
        recorder.flush()?;
        Ok(recorder)
    }
}

impl<W: Medium> Recorder<W> {
    /// Begins a recording with the definitions of all channels, which are flushed at once: without them no message can be
    /// read.
    pub fn new(medium: W, scene: Scene) -> Result<Self, WriteError> {
        Self::with_frames(medium, scene, Some(FrameBatch::default()))
    }

    fn with_frames(medium: W, scene: Scene, frames: Option<FrameBatch>) -> Result<Self, WriteError> {
        let writer = options().create(NoSeek::new(medium))?;
        let file = RecordingFile { writer, ids: [None; Channel::COUNT] };
        let mut recorder = Self { file, encoder: Encoder::new(scene), frames };
        recorder.declare(&Declared::default())?;
        Ok(recorder)
    }

    /// Adds the channels of the signals and parameters that a controller declares; before, their messages are left out.
    pub fn declare(&mut self, declared: &Declared) -> Result<(), WriteError> {
        let RecordingFile { writer, ids } = &mut self.file;
        for (channel, id) in Channel::all().zip(ids) {
            let is_left_out = match channel {
                Channel::Frames => self.frames.is_none(),
                other => other == Channel::Topic(Topic::Frame),
            };
            if id.is_none()
                && !is_left_out
                && let Some(definition) = definition(channel, declared)
            {
                let schema = add_schema(writer, &definition)?;
                let mcap::Channel { topic, message_encoding, metadata, .. } = &definition;
                *id = Some(writer.add_channel(schema, topic, message_encoding, metadata)?);
            }
        }
        Ok(writer.flush()?)
    }

    /// Attaches a file.
    pub fn attach(&mut self, name: &str, media_type: &str, data: &[u8]) -> Result<(), WriteError> {
        Ok(self.file.writer.attach(&timeless(name, media_type, data))?)
    }

    /// Appends a message that was received at `log_time_ns`, and its view in 3-D.
    pub fn record(&mut self, message: &Recorded, log_time_ns: u64) -> Result<(), WriteError> {
        if let Recorded::Frame(frame) = message {
            return self.record_frame(frame, log_time_ns);
        }
        self.end_frames()?;
        let Self { file, encoder, .. } = self;
        encoder.encode(message, |message| file.write_message(&message, log_time_ns))
    }

    fn record_frame(&mut self, frame: &FrameTap, log_time_ns: u64) -> Result<(), WriteError> {
        if self.frames.as_ref().is_some_and(|frames| !frames.takes(frame, log_time_ns)) {
            self.end_frames()?;
        }
        if let Some(frames) = &mut self.frames {
            frames.push_frame(frame, log_time_ns);
        }
        Ok(())
    }

    /// Writes the frames gathered so far, so that messages stay in their order.
    fn end_frames(&mut self) -> Result<(), WriteError> {
        let Some(frames) = &mut self.frames else { return Ok(()) };
        let log_time_ns = frames.log_time_ns;
        let Some((first, bytes)) = frames.end_batch() else { return Ok(()) };
        let (sequence, publish_time_ns) = (first.seq as u32, first.published_ns);
        let message = Encoded { channel: Channel::Frames, sequence, publish_time_ns, bytes };
        self.file.write_message(&message, log_time_ns)
    }

    /// Ends the chunk and hands everything recorded so far to the medium.
    pub fn flush(&mut self) -> Result<(), WriteError> {
        self.end_frames()?;
        Ok(self.file.writer.flush()?)
    }

    /// Ends the file with its index, and waits until it is safe.
    pub fn finish(mut self) -> Result<(), WriteError> {
        self.end_frames()?;
        self.file.writer.finish()?;
        Ok(self.file.writer.into_inner().into_inner().close().map_err(McapError::from)?)
    }
}

/// A file whose flush reaches the system at once and the disk soon after: flushed bytes survive the
/// death of the process, and, once the disk has taken it, a power cut.
///
/// A thread of its own waits for the disk, so that a slow one does not hold the writer up. Closing the file
/// waits for the last of it.
#[derive(Debug)]
pub struct DurableFile {
    file: BufWriter<File>,
    requests: Option<SyncSender<()>>,
    done: Receiver<io::Result<()>>,
}

impl DurableFile {
    /// Creates the file, which must not exist, and its entry in the folder.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = File::create_new(path)?;
        if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
            File::open(folder)?.sync_all()?;
        }
        Self::syncing(file)
    }

    fn syncing(file: File) -> io::Result<Self> {
        // One request may wait while another is carried out: it covers all that came before it.
        let (request, requests) = sync_channel(1);
        let (report, done) = channel();
        let for_disk = file.try_clone()?;
        thread::spawn(move || {
            for () in requests {
                let _ = report.send(for_disk.sync_data());
            }
        });
        let file = BufWriter::with_capacity(BUFFER_BYTES, file);
        Ok(Self { file, requests: Some(request), done })
    }

    /// Waits until the disk has taken, or refused, everything that was flushed.
    fn await_disk(&mut self) -> io::Result<()> {
        self.requests = None;
        // Until the thread has ended.
        self.done.iter().fold(Ok(()), io::Result::and)
    }
}

impl Medium for DurableFile {
    fn close(mut self) -> io::Result<()> {
        self.flush()?;
        self.await_disk()
    }
}

impl Drop for DurableFile {
    fn drop(&mut self) {
        // The error of a file that was not closed is reported elsewhere.
        let _ = self.await_disk();
    }
}

impl Write for DurableFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    /// Also reports an earlier flush that the disk refused.
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()?;
        self.done.try_iter().collect::<io::Result<()>>()?;
        if let Some(request) = &self.requests {
            // A request that waits already covers this one too.
            let _ = request.try_send(());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_disk_that_refuses_the_last_bytes_is_reported() {
        // It accepts writes and refuses to sync.
        let null = File::options().write(true).open("/dev/null").unwrap();
        let error = DurableFile::syncing(null).unwrap().close().unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::InvalidInput);
    }
}
