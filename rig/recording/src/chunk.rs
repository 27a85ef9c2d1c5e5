//! The records of one chunk, which counts as a whole: unpacked and checked before any of them is read.

use mcap::McapError;
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::walk::{HEAD, LONGEST_RECORD};

/// The records of a chunk, and the bytes that they take unpacked.
pub(super) fn unpack(chunk: &[u8]) -> Result<(Vec<Record<'static>>, u64), McapError> {
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
