//! Bit rates, and lengths of frames in bits: exact from the content, and at worst (ISO 11898-1).
//!
//! The lengths do not cover error frames, which are part of [`VirtualWire`](crate::VirtualWire).

use crate::frame::{CanId, Frame};

/// A bit rate that CAN does not have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bit rate {0} bit/s is outside classical CAN (1 to 1000000 bit/s)")]
pub struct BitrateError(pub u32);

/// Bit rate of a bus, bit/s.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Bitrate(u32);

impl Bitrate {
    /// The highest bit rate of classical CAN, 1 Mbit/s.
    pub const MAX: Self = Self(1_000_000);
    /// One bit a nanosecond, which no CAN has. A frame takes about 0.14 µs, so the software alone decides the time of a
    /// run.
    pub const IDEAL: Self = Self(1_000_000_000);

    /// A bit rate of 1 to 1 000 000 bit/s.
    ///
    /// # Errors
    /// [`BitrateError`] for 0 and for more than 1 Mbit/s.
    pub const fn new(bps: u32) -> Result<Self, BitrateError> {
        if bps == 0 || bps > Self::MAX.0 { Err(BitrateError(bps)) } else { Ok(Self(bps)) }
    }

    /// Bits a second.
    pub const fn bps(self) -> u32 {
        self.0
    }

    /// Duration of that many bits, rounded up, ns.
    pub const fn bits_to_ns(self, bits: u32) -> u64 {
        (bits as u64 * 1_000_000_000).div_ceil(self.0 as u64)
    }
}

/// Pause between two frames.
pub const INTERFRAME_BITS: u32 = 3;
/// Acknowledge delimiter and end of frame.
pub(crate) const BEHIND_ACKNOWLEDGE_BITS: u32 = 1 + 7;
/// CRC delimiter, acknowledge slot, and the bits behind.
const TRAILER_BITS: u32 = 1 + 1 + BEHIND_ACKNOWLEDGE_BITS;
const CRC_BITS: u32 = 15;
const CRC_POLYNOMIAL: u16 = 0x4599;
const CRC_MASK: u16 = (1 << CRC_BITS) - 1;
/// Bytes of the number that holds a content.
const CONTENT_BYTES: usize = 16;
static CRC_OF_BYTE: [[u16; 256]; CONTENT_BYTES] = crc_of_bytes();
const STANDARD_HEADER_BITS: u32 = 19;
const EXTENDED_HEADER_BITS: u32 = 39;

/// Exact length of a frame on the wire from the start bit to the end of the interframe space, bits.
pub fn frame_bits(frame: &Frame) -> u32 {
    let (content, content_bits) = content(frame);
    let stuffed = content << CRC_BITS | u128::from(crc15(content));
    let stuffed_bits = content_bits + CRC_BITS;
    stuffed_bits + stuff_bits(stuffed, stuffed_bits) + TRAILER_BITS + INTERFRAME_BITS
}

/// Length of a frame of that many data bytes without any stuff bit, interframe space included, bits.
pub const fn unstuffed_bits(data_length: u32, extended: bool) -> u32 {
    header_bits(extended) + 8 * data_length + CRC_BITS + TRAILER_BITS + INTERFRAME_BITS
}

/// Length of a frame of `n` data bytes with the most stuff bits and the interframe space, bits. The length is 55 + 10
/// n, or 80 + 10 n with a 29-bit identifier (Davis, Burns, Bril and Lukkien, Real-Time Systems 35, 2007).
pub const fn worst_case_bits(data_length: u32, extended: bool) -> u32 {
    // Five equal bits cause the first stuff bit, which with four more causes the next.
    let stuffed_bits = header_bits(extended) + 8 * data_length + CRC_BITS;
    unstuffed_bits(data_length, extended) + (stuffed_bits - 1) / 4
}

const fn header_bits(extended: bool) -> u32 {
    if extended { EXTENDED_HEADER_BITS } else { STANDARD_HEADER_BITS }
}

/// The bits under the CRC, from the start bit to the last data bit, in the low end of a number. The second value is
/// their count, at most 103.
fn content(frame: &Frame) -> (u128, u32) {
    let length = frame.data().len() as u32;
    let bits = 8 * length;
    let shifted_data = u128::from(u64::from_be_bytes(*frame.padded())) >> (64 - bits);
    let header = u128::from(header(frame.id(), length));
    (header << bits | shifted_data, header_bits(frame.id().is_extended()) + bits)
}

/// Start bit, arbitration and control field. Start, RTR and the reserved bits are 0; the length code
/// takes the lowest four.
fn header(id: CanId, length: u32) -> u64 {
    const SRR_AND_IDE: u64 = 0b11;
    let base = u64::from(id.base());
    let arbitration =
        if id.is_extended() { (base << 2 | SRR_AND_IDE) << 18 | u64::from(id.extension()) } else { base };
    arbitration << 7 | u64::from(length)
}

/// CRC of a content. The CRC starts from zero and is linear. So the CRCs of the bytes at their places add up, and the
/// zeros above the content add nothing.
fn crc15(content: u128) -> u16 {
    let bytes = content.to_le_bytes();
    bytes.iter().zip(&CRC_OF_BYTE).fold(0, |crc, (byte, of_byte)| crc ^ of_byte[usize::from(*byte)])
}

/// The CRC of each byte with this many bytes of zeros behind it.
const fn crc_of_bytes() -> [[u16; 256]; CONTENT_BYTES] {
    let mut tables = [[0; 256]; CONTENT_BYTES];
    let mut byte = 0;
    while byte < 256 {
        let (mut crc, mut place) = ((byte as u16) << (CRC_BITS - 8), 0);
        while place < CONTENT_BYTES {
            let mut bit = 0;
            while bit < 8 {
                let carry = crc >> (CRC_BITS - 1) & 1;
                crc = (crc << 1 & CRC_MASK) ^ (carry * CRC_POLYNOMIAL);
                bit += 1;
            }
            tables[place][byte] = crc;
            place += 1;
        }
        byte += 1;
    }
    tables
}

/// Bit stuffing: after five equal bits follows one bit of the other level, which counts towards the next five (10.5).
///
/// Number of stuff bits in the lowest `length` bits of `sequence`, from the highest bit on. A stuff bit due behind the
/// last bit counts.
fn stuff_bits(sequence: u128, length: u32) -> u32 {
    if length == 0 {
        return 0;
    }
    // Index 0 is the highest bit, the first on the wire.
    let bits = sequence << (u128::BITS - length);
    let equals_next = !(bits ^ bits << 1) & !u128::MAX.unbounded_shr(length - 1);
    let begins_four = equals_next & equals_next << 1 & equals_next << 2;
    let begins_five = begins_four & equals_next << 3;
    // A stuff bit and four bits of its level.
    let precedes_four_others = begins_four << 1 & !equals_next;
    let mut stuffed = 0;
    // The bits from here on follow a stuff bit, or are the first.
    let mut from = 0;
    while from < length {
        let is_chained = from > 0 && precedes_four_others << (from - 1) >> (u128::BITS - 1) == 1;
        from = match (begins_five << from).leading_zeros() {
            _ if is_chained => from + 4,
            u128::BITS => break,
            zeros => from + zeros + 5,
        };
        stuffed += 1;
    }
    stuffed
}

/// The first difference on the wire of two frames with one identifier, and the dominant frame there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Difference {
    /// Number of the bit, counted from 1 with stuff bits.
    pub(crate) bit: u32,
    /// Whether the first frame sends the dominant level.
    pub(crate) first_is_dominant: bool,
}

/// The first difference of two frames with one identifier, where one transmitter detects an error; `None` for equal
/// frames. Frames with equal data have equal CRCs, so the content alone decides.
pub(crate) fn first_difference(first: &Frame, second: &Frame) -> Option<Difference> {
    let [first, second] = [first, second].map(|frame| {
        let (content, length) = content(frame);
        content << (u128::BITS - length)
    });
    // Frames of different length differ in their length codes, which lie before the data.
    let index = (first != second).then_some((first ^ second).leading_zeros())?;
    let stuffed = stuff_bits(first.unbounded_shr(u128::BITS - index), index);
    Some(Difference { bit: index + 1 + stuffed, first_is_dominant: first < second })
}

#[cfg(test)]
mod tests;
