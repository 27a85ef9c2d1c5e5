//! Writes the readable part of a damaged recording into a new, whole one.
//!
//! Messages and channels keep their bytes, numbers and times; schemas are numbered anew, since damage may have given
//! two of them the same number. Attachments and metadata, which Masseter does not write, are not carried over.

use std::collections::BTreeSet;
use std::io::{Read, Seek, Write};

use mcap::records::Channel;
use mcap::{McapError, Writer};

use super::reader::{ReadError, Reader};
use super::schema::Schema;
use super::writer::{LIBRARY, options};

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
pub fn recover<R: Read + Seek, W: Write + Seek>(
    reader: &mut Reader<R>,
    medium: W,
) -> Result<Recovered, RecoverError> {
    // The header names another library, since this version may number the channels of its own recordings differently.
    let mut writer = options().library(format!("{LIBRARY} recover")).create(medium)?;
    let mut defined = BTreeSet::new();
    let mut recovered = Recovered::default();
    while let Some(entry) = reader.next_entry()? {
        let Some(channel) = entry.channel else {
            recovered.undefined += 1;
            continue;
        };
        if defined.insert(channel.id) {
            define(&mut writer, channel, entry.schema)?;
        }
        writer.write_to_known_channel(&entry.header, entry.data)?;
        recovered.messages += 1;
    }
    writer.finish()?;
    Ok(recovered)
}

/// A channel whose schema is lost is defined without one, so that its messages are kept.
fn define<W: Write + Seek>(
    writer: &mut Writer<W>,
    channel: &Channel,
    schema: Option<&Schema>,
) -> Result<(), McapError> {
    let schema_id = match schema {
        Some(schema) => writer.add_schema(&schema.name, &schema.encoding, &schema.data)?,
        None => 0,
    };
    writer.add_channel_with_id(
        channel.id,
        schema_id,
        &channel.topic,
        &channel.message_encoding,
        &channel.metadata,
    )?;
    Ok(())
}
