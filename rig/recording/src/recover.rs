//! Writes the readable part of a damaged recording into a new, whole one.
//!
//! Messages, channels and attached files keep their bytes, numbers and times; schemas are numbered anew, since damage may
//! have given two of them the same number. Metadata, which Masseter does not write, are not carried over.

use std::collections::BTreeSet;
use std::io::{Read, Seek, Write};

use mcap::McapError;

use super::reader::{Entry, ReadError, Reader};
use super::writer::{add_schema, options};

/// Why a recording could not be recovered.
#[derive(Debug, thiserror::Error)]
pub enum RecoverError {
    /// Nothing can be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new recording cannot be written.
    #[error("cannot write the recovered recording: {0}")]
    Write(#[from] McapError),
}

/// Counts of saved and lost messages.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Messages saved.
    pub messages: u64,
    /// Messages whose channel has no definition any more; they are not saved.
    pub undefined: u64,
}

/// Copies everything readable from `reader` to `medium`. The rest is in the reader's [`damage`](Reader::damage).
///
/// A channel whose schema is lost is defined without one, so that its messages are kept.
///
/// ```
/// use std::io::Cursor;
///
/// use masseter_recording::{Reader, Recorded, Recorder, Scene, recover};
/// # use masseter_scenario::Scenario;
/// # use masseter_model::geometry::{Mechanism, MechanismConfig};
/// # use masseter_runtime::messages::{Message, State};
///
/// # let folder = tempfile::tempdir()?;
/// # let path = folder.path().join("recording.mcap");
/// # let scene = Scene::new(&Mechanism::new(&MechanismConfig::default())?, &Scenario::default().jaw);
/// # let mut state = State::default();
/// # state.stamp(1, 1_000_000);
/// let mut recorder = Recorder::create(&path, scene)?;
/// recorder.record(&Recorded::State(state), 1_000_000)?;
/// recorder.flush()?;
/// let mut whole = Vec::new();
/// let recovered = recover(&mut Reader::open(&path)?, Cursor::new(&mut whole))?;
/// assert_eq!(recovered.undefined, 0);
/// assert!(Reader::new(Cursor::new(&whole))?.next_message()?.is_some());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn recover<R: Read + Seek, W: Write + Seek>(
    reader: &mut Reader<R>,
    medium: W,
) -> Result<Recovered, RecoverError> {
    let mut writer = options().create(medium)?;
    let mut definitions = Definitions::default();
    let mut recovered = Recovered::default();
    while let Some(Entry { channel, header, data }) = reader.next_entry()? {
        if channel.is_none() {
            recovered.undefined += 1;
            continue;
        }
        if !definitions.channels.contains(&header.channel_id) {
            definitions.copy(reader, &mut writer)?;
        }
        writer.write_to_known_channel(&header, &data)?;
        recovered.messages += 1;
    }
    definitions.copy(reader, &mut writer)?;
    writer.finish()?;
    Ok(recovered)
}

/// What has been copied beside messages. A reader of the new recording looks for it before the first message.
#[derive(Default)]
struct Definitions {
    channels: BTreeSet<u16>,
    attachments: usize,
}

impl Definitions {
    /// Copies the channels and attached files that the reader has come to know since the last call.
    fn copy<R: Read + Seek, W: Write + Seek>(
        &mut self,
        reader: &Reader<R>,
        writer: &mut mcap::Writer<W>,
    ) -> Result<(), McapError> {
        for attachment in &reader.attachments()[self.attachments..] {
            writer.attach(attachment)?;
        }
        self.attachments = reader.attachments().len();
        for channel in reader.channels() {
            let mcap::Channel { id, topic, message_encoding, metadata, .. } = channel;
            if self.channels.insert(*id) {
                let schema = add_schema(writer, channel)?;
                writer.add_channel_with_id(*id, schema, topic, message_encoding, metadata)?;
            }
        }
        Ok(())
    }
}
