//! Thins a recording: whole messages of a few cycles, and the digests of all. So it is small enough for a repository, still
//! tells in which cycle and topic another run first differs from it, and soon after that by how much.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::io::{Read, Seek, Write};

use mcap::{Attachment, McapError};

use super::digests::{Digester, Digests};
use super::reader::{Entry, ReadError, Reader};
use super::topic::{Recorded, Topic};
use super::writer::{add_schema, options};

/// A thinned recording has the messages of every so many cycles.
const EVERY: u64 = 100;

/// Why a recording could not be thinned.
#[derive(Debug, thiserror::Error)]
pub enum ThinError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It lacks messages.
    #[error("the recording is incomplete: 'masseter recording verify' says where; record the run again")]
    Incomplete,
    /// Another run cannot give the same messages.
    #[error("a run in real time never gives the same messages again: record it with --clock virtual")]
    RealTime,
    /// It is thinned.
    #[error("the recording is thinned already: thin that of a whole run")]
    Thinned,
    /// The new recording cannot be written.
    #[error("cannot write the thinned recording: {0}")]
    Write(#[from] McapError),
}

/// Whether a thinned recording has this message.
pub fn is_kept(message: &Recorded) -> bool {
    match message.topic() {
        Topic::Frame | Topic::Machine => false,
        Topic::Event | Topic::Parameters => true,
        _ => message.cycle().is_some_and(|cycle| cycle % EVERY == 0),
    }
}

/// Writes the thinned recording of a run in simulated time to `medium`. Returns the number of messages that it keeps.
///
/// # Errors
/// [`ThinError`], before anything is written unless writing itself fails.
pub fn thin<R: Read + Seek, W: Write + Seek>(reader: &mut Reader<R>, medium: W) -> Result<u64, ThinError> {
    let (mut digester, mut kept) = (Digester::default(), Vec::new());
    while let Some(entry) = reader.next_entry()? {
        // Of frames only the digest is kept.
        for frame in entry.frames().transpose()?.into_iter().flatten() {
            digester.take(&Recorded::Frame(frame));
        }
        let Some(message) = entry.recorded().transpose()? else { continue };
        digester.take(&message);
        kept.extend(is_kept(&message).then_some(entry));
    }
    if reader.was_cut_short() || !reader.damage().is_empty() {
        return Err(ThinError::Incomplete);
    }
    if reader.is_in_real_time() {
        return Err(ThinError::RealTime);
    }
    if !Digests::attached(reader.attachments()).is_empty() {
        return Err(ThinError::Thinned);
    }
    write(reader.attachments(), &digester.finish(), &kept, medium)?;
    Ok(kept.len() as u64)
}

/// Attached files come first, so that a reader knows them before the first message.
fn write<W: Write + Seek>(
    attachments: &[Attachment],
    digests: &Digests,
    kept: &[Entry],
    medium: W,
) -> Result<(), McapError> {
    let mut writer = options().create(medium)?;
    attachments.iter().try_for_each(|attachment| writer.attach(attachment))?;
    for (name, data) in digests.to_files() {
        let (media_type, data) = ("application/octet-stream".to_owned(), Cow::Owned(data));
        writer.attach(&Attachment { log_time: 0, create_time: 0, name, media_type, data })?;
    }
    // Also the definitions of all channels do.
    let mut defined = BTreeSet::new();
    for channel in kept.iter().filter_map(|entry| entry.channel.as_ref()) {
        let mcap::Channel { id, topic, message_encoding, metadata, .. } = &**channel;
        if defined.insert(*id) {
            let schema = add_schema(&mut writer, channel)?;
            writer.add_channel_with_id(*id, schema, topic, message_encoding, metadata)?;
        }
    }
    kept.iter().try_for_each(|Entry { header, data, .. }| writer.write_to_known_channel(header, data))?;
    writer.finish()?;
    Ok(())
}
