//! One chunk: unpacked, checked, and read record by record.

use std::ops::Range;

use mcap::McapError;
use mcap::records::{ChunkHeader, Record, op};
use zstd::bulk::Decompressor;

use super::walk::LONGEST_RECORD;

/// Opcode and length of a record.
const HEAD: usize = 9;

/// Why a chunk cannot be read.
#[derive(Debug, thiserror::Error)]
pub(super) enum ChunkError {
    #[error("a chunk whose header makes no sense ({0})")]
    Header(#[from] McapError),
    #[error("a chunk that claims {0} bytes of content")]
    TooLong(u64),
    #[error("a chunk with compression '{0}', which is not read here")]
    Compression(String),
    #[error("a chunk that cannot be unpacked ({0})")]
    Unpack(#[from] std::io::Error),
    #[error("a chunk of {found} bytes that should hold {expected}")]
    Length { found: usize, expected: u64 },
    #[error("a chunk with checksum {found:08x} that should have {expected:08x}")]
    Checksum { found: u32, expected: u32 },
}

/// The content of the chunk that is being read.
pub(super) struct Chunk {
    unpack: Decompressor<'static>,
    content: Vec<u8>,
    at: usize,
}

impl Default for Chunk {
    fn default() -> Self {
        let unpack = Decompressor::new().expect("a decompressor needs memory alone");
        Self { unpack, content: Vec::new(), at: 0 }
    }
}

impl Chunk {
    /// Opens the chunk in this record's body, if it is whole.
    pub(super) fn open(&mut self, body: &[u8]) -> Result<ChunkHeader, ChunkError> {
        self.content.clear();
        self.at = 0;
        let Record::Chunk { header, data } = mcap::parse_record(op::CHUNK, body)? else {
            unreachable!("the opcode is a chunk's");
        };
        let checked = self.unpack(&header, &data).and_then(|()| check(&header, &self.content));
        if checked.is_err() {
            self.content.clear();
        }
        checked.map(|()| header)
    }

    fn unpack(&mut self, header: &ChunkHeader, data: &[u8]) -> Result<(), ChunkError> {
        match header.compression.as_str() {
            "" => self.content.extend_from_slice(data),
            "zstd" if header.uncompressed_size > LONGEST_RECORD => {
                return Err(ChunkError::TooLong(header.uncompressed_size));
            }
            "zstd" => {
                self.content.reserve(header.uncompressed_size as usize);
                self.unpack.decompress_to_buffer(data, &mut self.content)?;
            }
            other => return Err(ChunkError::Compression(other.to_owned())),
        }
        Ok(())
    }

    /// Opcode and place of the next record; an error, once, where the rest is no record.
    pub(super) fn next_record(&mut self) -> Option<Result<(u8, Range<usize>), &'static str>> {
        let rest = &self.content[self.at..];
        if rest.is_empty() {
            return None;
        }
        let begin = self.at + HEAD;
        let length =
            rest.get(1..HEAD).map(|bytes| u64::from_le_bytes(bytes.try_into().expect("eight bytes")));
        match length {
            Some(length) if length <= (rest.len() - HEAD) as u64 => {
                self.at = begin + length as usize;
                Some(Ok((rest[0], begin..self.at)))
            }
            _ => {
                self.at = self.content.len();
                Some(Err("a chunk that ends in the middle of a record"))
            }
        }
    }

    /// The bytes of a record.
    pub(super) fn bytes(&self, place: Range<usize>) -> &[u8] {
        &self.content[place]
    }
}

/// Whether length and checksum of the content are those of the header. 0 stands for no checksum.
fn check(header: &ChunkHeader, content: &[u8]) -> Result<(), ChunkError> {
    if content.len() as u64 != header.uncompressed_size {
        return Err(ChunkError::Length { found: content.len(), expected: header.uncompressed_size });
    }
    let (found, expected) = (crc32fast::hash(content), header.uncompressed_crc);
    if expected != 0 && found != expected {
        return Err(ChunkError::Checksum { found, expected });
    }
    Ok(())
}
