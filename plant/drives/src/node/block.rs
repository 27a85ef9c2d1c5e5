//! The server's part of a block transfer (CiA 301): the segments that it sends or takes, and its acknowledgements.
//!
//! A segment that is lost ends the order of its block. The rest of the block is acknowledged as lost, and sent again.
//! Time-outs are the matter of the [server](super::sdo). The server never uploads in segments instead ("protocol
//! switch").

use masseter_can::canopen::{AbortCode, BlockMessage, BlockSegment, block_crc};

/// Segments of a block that a client sends. A client sends a whole block at once: transmit queues hold 64 frames, and a
/// block whose last segment is lost ends only by a time-out.
pub(super) const BLOCK_SIZE: u8 = 32;

/// An object that the server sends.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct BlockUpload {
    data: Vec<u8>,
    has_crc: bool,
    /// Segments of the present block.
    block_size: u8,
    /// Segments that came in order, in all blocks.
    acknowledged: usize,
    phase: Phase,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Phase {
    /// The client has not asked for the first block yet.
    Offered,
    /// So many segments of the present block are sent.
    Sending { sent: u8 },
    /// The client has everything and must confirm it.
    Ending,
}

impl BlockUpload {
    /// Data for a client that takes so many segments at once.
    ///
    /// # Errors
    /// [`AbortCode::BLOCK_SIZE`].
    pub(super) fn new(data: Vec<u8>, has_crc: bool, block_size: u8) -> Result<Self, AbortCode> {
        let block_size = checked(block_size)?;
        Ok(Self { data, has_crc, block_size, acknowledged: 0, phase: Phase::Offered })
    }

    /// Whether only the client's confirmation is missing.
    pub(super) fn is_ending(&self) -> bool {
        self.phase == Phase::Ending
    }

    /// The segments of the object: one carries nothing where there are no data.
    fn segments(&self) -> usize {
        self.data.len().div_ceil(BlockSegment::DATA).max(1)
    }

    /// The next segment of the present block.
    pub(super) fn next_segment(&mut self) -> Option<BlockSegment> {
        let (whole, place) = (self.segments(), self.acknowledged);
        let Phase::Sending { sent } = &mut self.phase else { return None };
        let place = place + usize::from(*sent);
        if *sent == self.block_size || place == whole {
            return None;
        }
        *sent += 1;
        let rest = &self.data[place * BlockSegment::DATA..];
        let mut data = [0; BlockSegment::DATA];
        let length = rest.len().min(data.len());
        data[..length].copy_from_slice(&rest[..length]);
        Some(BlockSegment { sequence: *sent, is_last: place + 1 == whole, data })
    }

    /// Takes a message of the client; returns the answer.
    pub(super) fn take(&mut self, message: BlockMessage) -> Result<Option<BlockMessage>, AbortCode> {
        match (self.phase, message) {
            (Phase::Offered, BlockMessage::Start) => self.phase = Phase::Sending { sent: 0 },
            (Phase::Sending { sent }, BlockMessage::Acknowledge { sequence, .. }) if sequence > sent => {
                return Err(AbortCode::SEQUENCE);
            }
            (Phase::Sending { .. }, BlockMessage::Acknowledge { sequence, block_size }) => {
                self.acknowledged += usize::from(sequence);
                if self.acknowledged == self.segments() {
                    self.phase = Phase::Ending;
                    let unused = self.acknowledged * BlockSegment::DATA - self.data.len();
                    let crc = if self.has_crc { block_crc(&self.data) } else { 0 };
                    return Ok(Some(BlockMessage::EndSending { unused: unused as u8, crc }));
                }
                (self.block_size, self.phase) = (checked(block_size)?, Phase::Sending { sent: 0 });
            }
            _ => return Err(AbortCode::UNKNOWN_COMMAND),
        }
        Ok(None)
    }
}

/// The segments of a block, if a block can have so many.
fn checked(block_size: u8) -> Result<u8, AbortCode> {
    if (1..=BlockSegment::MAX).contains(&block_size) { Ok(block_size) } else { Err(AbortCode::BLOCK_SIZE) }
}

/// An object that the server receives.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct BlockDownload {
    received: Vec<u8>,
    has_crc: bool,
    announced: Option<u32>,
    /// Bytes that the object can take.
    room: usize,
    /// The last segment of the present block that came in order.
    sequence: u8,
    is_whole: bool,
}

impl BlockDownload {
    /// Nothing received yet.
    pub(super) fn new(has_crc: bool, announced: Option<u32>, room: usize) -> Self {
        Self { received: Vec::new(), has_crc, announced, room, sequence: 0, is_whole: false }
    }

    /// Whether the last segment came in order.
    pub(super) fn is_whole(&self) -> bool {
        self.is_whole
    }

    /// Takes a segment; returns the acknowledgement at the end of a block.
    pub(super) fn take(&mut self, segment: BlockSegment) -> Result<Option<BlockMessage>, AbortCode> {
        if segment.sequence == self.sequence + 1 {
            self.sequence = segment.sequence;
            self.received.extend_from_slice(&segment.data);
            self.is_whole = segment.is_last;
        }
        if self.received.len() >= self.room + BlockSegment::DATA {
            return Err(AbortCode::TOO_LONG);
        }
        let ends = segment.is_last || segment.sequence == BLOCK_SIZE;
        let sequence = ends.then(|| std::mem::take(&mut self.sequence));
        Ok(sequence.map(|sequence| BlockMessage::Acknowledge { sequence, block_size: BLOCK_SIZE }))
    }

    /// The data, once the client has sent all.
    pub(super) fn end(&mut self, unused: u8, crc: u16) -> Result<&[u8], AbortCode> {
        if !self.is_whole {
            return Err(AbortCode::UNKNOWN_COMMAND);
        }
        self.received.truncate(self.received.len().saturating_sub(unused.into()));
        if self.has_crc && crc != block_crc(&self.received) {
            return Err(AbortCode::CRC);
        }
        if self.announced.is_some_and(|size| size as usize != self.received.len()) {
            return Err(AbortCode::LENGTH);
        }
        Ok(&self.received)
    }
}
