//! Reads an MCAP file record by record, and finds the next chunk behind damage.
//!
//! The crate `mcap` stops at the first inconsistent record and does not look for the next chunk. But a recording that
//! lost a few bytes in the middle is readable behind them: every chunk can be read alone, and the lengths in its header,
//! which must agree, distinguish a chunk from other bytes.

use std::io::{self, Read, Seek, SeekFrom};

use crc32fast::Hasher;
use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{MAGIC, McapError};

/// A record longer than this is taken for damage, bytes; chunks stay far below.
const LONGEST_RECORD: u64 = 64 << 20;
/// Opcode and length.
const HEAD: usize = 9;
/// Chunk header up to the compression's name: two times, size, checksum, length of the name.
const CHUNK_FIXED: usize = 8 + 8 + 8 + 4 + 4;
/// Longest name of a compression that is accepted.
const LONGEST_NAME: usize = 16;
/// Bytes by which the beginning of a chunk is recognised.
const CHUNK_HEAD: usize = HEAD + CHUNK_FIXED + LONGEST_NAME + 8;
const SCAN_BYTES: usize = 1 << 16;

/// A stretch of the file that could not be read.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, thiserror::Error)]
#[error("bytes {from} to {to}: {reason}")]
pub struct Damage {
    /// Its first byte.
    pub from: u64,
    /// The byte behind it.
    pub to: u64,
    /// The defect.
    pub reason: String,
}

/// The next part of the file.
#[derive(Debug)]
pub(super) enum Step {
    /// A record of this opcode, whole; see [`Walk::body`].
    Record(u8),
    /// Bytes that are no record.
    Damage(Damage),
    /// The end of the file.
    End,
}

/// A walk through a file.
pub(super) struct Walk<R> {
    source: R,
    /// Bytes of the file.
    pub(super) size: u64,
    /// Where the current record began.
    at: u64,
    /// Where the next record begins.
    next: u64,
    /// Whether it is between the end of the data and the footer.
    pub(super) is_in_index: bool,
    /// Whether the last record was a footer.
    is_end_due: bool,
    /// Checksum of the current section of the file; none once damage was found in it.
    section: Option<Hasher>,
    /// The current record with opcode and length.
    pub(super) record: Vec<u8>,
    /// The byte behind the closing magic, once it was read.
    pub(super) end: Option<u64>,
}

impl<R: Read + Seek> Walk<R> {
    pub(super) fn new(mut source: R) -> io::Result<Self> {
        let size = source.seek(SeekFrom::End(0))?;
        source.rewind()?;
        Ok(Self::from(source, size, 0, Some(Hasher::new())))
    }

    fn from(source: R, size: u64, next: u64, section: Option<Hasher>) -> Self {
        let (is_in_index, is_end_due) = (false, false);
        Self { source, size, at: next, next, is_in_index, is_end_due, section, record: Vec::new(), end: None }
    }

    /// Another walk from here on; [`Self::seek_next`] continues this one.
    pub(super) fn ahead(&mut self) -> Walk<&mut R> {
        Walk::from(&mut self.source, self.size, self.next, None)
    }

    pub(super) fn seek_next(&mut self) -> io::Result<()> {
        self.source.seek(SeekFrom::Start(self.next)).map(|_| ())
    }

    /// The current record's content.
    pub(super) fn body(&self) -> &[u8] {
        &self.record[HEAD..]
    }

    /// The current record as a stretch of the file that is damaged.
    pub(super) fn damaged(&mut self, reason: String) -> Damage {
        self.section = None;
        self.stretch(reason)
    }

    /// The next record, or the next stretch that is no record.
    pub(super) fn step(&mut self) -> io::Result<Step> {
        self.at = self.next;
        let left = self.size - self.at;
        if left == 0 {
            return Ok(Step::End);
        }
        if self.end == Some(self.at) {
            self.next = self.size;
            return Ok(Step::Damage(self.stretch("bytes behind the end of the recording".to_owned())));
        }
        self.record.resize(left.min(HEAD as u64) as usize, 0);
        self.source.read_exact(&mut self.record)?;
        if self.at == 0 {
            return self.pass_opening_magic();
        }
        if self.record.starts_with(MAGIC) || self.is_end_due && left >= MAGIC.len() as u64 {
            return self.pass_closing_magic();
        }
        if left < HEAD as u64 {
            return self.resynchronise("the file ends in the middle of a record");
        }
        let length = u64_at(&self.record, 1).expect("the head holds nine bytes");
        if length > left - HEAD as u64 {
            return self.resynchronise("a record that is longer than the rest of the file");
        }
        if length > LONGEST_RECORD {
            return self.resynchronise("a record of impossible length");
        }
        self.record.resize(HEAD + length as usize, 0);
        self.source.read_exact(&mut self.record[HEAD..])?;
        if !is_consistent(self.record[0], self.body()) {
            return self.resynchronise("the lengths in a record contradict each other");
        }
        self.next = self.at + self.record.len() as u64;
        self.is_end_due = self.record[0] == op::FOOTER;
        Ok(self.check_section().map_or(Step::Record(self.record[0]), Step::Damage))
    }

    /// The data end with a checksum of everything before it, and the footer with a checksum of everything in between.
    /// They cover the bytes outside of the chunks; 0 stands for no checksum.
    fn check_section(&mut self) -> Option<Damage> {
        let (covered, ended) = match self.record[0] {
            op::DATA_END => (0, Some("what lies between the chunks")),
            op::FOOTER => (HEAD + 16, Some("the index")),
            _ => (self.record.len(), None),
        };
        if let Some(section) = &mut self.section {
            section.update(&self.record[..covered]);
        }
        let ended = ended?;
        self.is_in_index = self.record[0] == op::DATA_END;
        // The index has a checksum of its own.
        let found = self.section.replace(Hasher::new())?.finalize();
        let expected =
            u32::from_le_bytes(*self.record.last_chunk().expect("both are longer than their checksum"));
        (expected != 0 && found != expected)
            .then(|| self.stretch(format!("{ended} has checksum {found:08x} and should have {expected:08x}")))
    }

    /// The eight bytes that begin every file.
    fn pass_opening_magic(&mut self) -> io::Result<Step> {
        if !self.record.starts_with(MAGIC) {
            return self.resynchronise("no MCAP file begins like this");
        }
        if let Some(section) = &mut self.section {
            section.update(MAGIC);
        }
        self.pass_magic()?;
        self.step()
    }

    /// The eight bytes that end every file behind its footer; one of both may be damaged.
    fn pass_closing_magic(&mut self) -> io::Result<Step> {
        self.pass_magic()?;
        self.end = Some(self.next);
        if !self.is_end_due || !self.record.starts_with(MAGIC) {
            return Ok(Step::Damage(self.stretch("no MCAP file ends like this".to_owned())));
        }
        self.step()
    }

    fn pass_magic(&mut self) -> io::Result<()> {
        self.next = self.at + MAGIC.len() as u64;
        self.seek_next()
    }

    /// Everything from here to the next landmark is damage; without one, to the end of the file.
    fn resynchronise(&mut self, reason: &str) -> io::Result<Step> {
        self.next = self.find_landmark(self.at + 1)?.unwrap_or(self.size);
        (self.is_in_index, self.is_end_due, self.section) = (false, false, None);
        self.seek_next()?;
        Ok(Step::Damage(self.stretch(reason.to_owned())))
    }

    /// The bytes from the last record to the next.
    fn stretch(&self, reason: String) -> Damage {
        Damage { from: self.at, to: self.next, reason }
    }

    /// The first place at or behind `from` where a chunk begins, or the magic that ends the file.
    fn find_landmark(&mut self, from: u64) -> io::Result<Option<u64>> {
        self.source.seek(SeekFrom::Start(from.min(self.size)))?;
        let mut window = Vec::new();
        let mut at = from;
        loop {
            let read = (&mut self.source).take(SCAN_BYTES as u64).read_to_end(&mut window)?;
            let found = window.iter().enumerate().find(|&(place, &byte)| {
                let rest = self.size - at - place as u64;
                match byte {
                    op::CHUNK => begins_chunk(&window[place..], rest),
                    _ => window[place..].starts_with(MAGIC),
                }
            });
            if let Some((place, _)) = found {
                return Ok(Some(at + place as u64));
            }
            if read == 0 {
                return Ok(None);
            }
            let done = window.len().saturating_sub(CHUNK_HEAD);
            window.drain(..done);
            at += done as u64;
        }
    }
}

/// Whether a chunk of at most `rest` bytes begins with these bytes.
fn begins_chunk(bytes: &[u8], rest: u64) -> bool {
    let Some(length) = u64_at(bytes, 1) else { return false };
    length <= LONGEST_RECORD && HEAD as u64 + length <= rest && chunk_length(&bytes[HEAD..]) == Some(length)
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    Some(u32::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize)
}

fn u64_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

/// Length of a chunk by its header and the compressed data it announces.
fn chunk_length(body: &[u8]) -> Option<u64> {
    let name = u32_at(body, CHUNK_FIXED - 4).filter(|name| *name <= LONGEST_NAME)?;
    let header = CHUNK_FIXED + name + 8;
    u64_at(body, header - 8)?.checked_add(header as u64)
}

/// Length of an attachment by those of its name, its media type and its data.
fn attachment_length(body: &[u8]) -> Option<u64> {
    let name = u32_at(body, 16)?;
    let media_type = u32_at(body, name.checked_add(20)?)?;
    let head = name.checked_add(media_type)?.checked_add(24)?;
    u64_at(body, head)?.checked_add(head as u64 + 12)
}

/// Whether the lengths inside a record agree with its own. Only records between chunks and before the footer are
/// checked: a wrong length there would hide the chunks behind, or the end.
fn is_consistent(opcode: u8, body: &[u8]) -> bool {
    let header_length = || {
        let profile = u32_at(body, 0)?;
        Some(profile + u32_at(body, profile.checked_add(4)?)? + 8)
    };
    match opcode {
        op::CHUNK => chunk_length(body) == Some(body.len() as u64),
        op::MESSAGE_INDEX => u32_at(body, 2).is_some_and(|entries| entries + 6 == body.len()),
        op::HEADER => header_length() == Some(body.len()),
        op::ATTACHMENT => attachment_length(body) == Some(body.len() as u64),
        op::FOOTER => body.len() == 20,
        op::DATA_END => body.len() == 4,
        op::SUMMARY_OFFSET => body.len() == 17,
        op::SCHEMA..op::SUMMARY_OFFSET => true,
        _ => false,
    }
}

/// The records of a chunk, and the bytes that they take unpacked. It counts as a whole: unpacked and checked before any of
/// them is read.
pub(super) fn unpack_chunk(chunk: &[u8]) -> Result<(Vec<Record<'static>>, u64), McapError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(LONGEST_RECORD as usize);
    let mut reader = LinearReader::new_with_options(options);
    let (mut records, mut bytes, mut rest) = (Vec::new(), 0, chunk);
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(most) => {
                let (given, behind) = rest.split_at(most.min(rest.len()));
                reader.insert(given.len()).copy_from_slice(given);
                reader.notify_read(given.len());
                rest = behind;
            }
            LinearReadEvent::Record { data, opcode } => {
                bytes += (HEAD + data.len()) as u64;
                // The size in the header is checked only beside a checksum, and a few bytes can unpack to any size.
                if bytes > LONGEST_RECORD {
                    return Err(McapError::ChunkTooLarge(bytes));
                }
                records.push(mcap::parse_record(opcode, data)?.into_owned());
            }
        }
    }
    Ok((records, bytes))
}
