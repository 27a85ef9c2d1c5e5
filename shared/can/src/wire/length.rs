//! Lengths of frames (ISO 11898-1).

use super::stuffing::stuff_bits;
use crate::frame::Frame;
use crate::id::CanId;

/// Pause after a frame before the next may start.
pub const INTERFRAME_BITS: u32 = 3;
/// Acknowledge delimiter and end of frame.
pub(crate) const BEHIND_ACKNOWLEDGE_BITS: u32 = 1 + 7;
/// CRC delimiter and acknowledge slot, and the bits behind it.
const TRAILER_BITS: u32 = 1 + 1 + BEHIND_ACKNOWLEDGE_BITS;
const CRC_BITS: u32 = 15;
const CRC_POLYNOMIAL: u16 = 0x4599;
const CRC_MASK: u16 = (1 << CRC_BITS) - 1;
/// Bytes of the number that has a content.
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

/// Length of a frame of that many data bytes with as many stuff bits as any content can cause,
/// interframe space included, bits: 55 + 10 n, or 80 + 10 n with a 29-bit identifier (Davis, Burns, Bril
/// and Lukkien, Real-Time Systems 35, 2007).
pub const fn worst_case_bits(data_length: u32, extended: bool) -> u32 {
    // Five equal bits cause the first stuff bit, which with four more causes the next.
    let stuffed_bits = header_bits(extended) + 8 * data_length + CRC_BITS;
    unstuffed_bits(data_length, extended) + (stuffed_bits - 1) / 4
}

const fn header_bits(extended: bool) -> u32 {
    if extended { EXTENDED_HEADER_BITS } else { STANDARD_HEADER_BITS }
}

/// The bits that the CRC protects, from the start bit to the last data bit, in the low end of the
/// number, and how many they are: at most 103.
pub(super) fn content(frame: &Frame) -> (u128, u32) {
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

/// CRC of a content. The CRC starts from zero and is linear: the CRCs of the bytes at their places add up, and the
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

#[cfg(test)]
mod tests {
    use super::super::stuffing::reference::{Stuffer, bits_of};
    use super::*;
    use crate::frame::strategies::any_frame;
    use proptest::prelude::*;

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::new(CanId::standard(id).unwrap(), data).unwrap()
    }

    /// The CRC as ISO 11898-1 writes it: a shift register.
    fn reference_crc(bits: impl Iterator<Item = bool>) -> u16 {
        bits.fold(0, |crc: u16, bit| {
            let shifted = crc << 1 & 0x7FFF;
            if bit ^ (crc >> 14 & 1 == 1) { shifted ^ 0x4599 } else { shifted }
        })
    }

    fn reference_stuffing(bits: impl Iterator<Item = bool>) -> u32 {
        let mut stuffer = Stuffer::default();
        bits.for_each(|bit| stuffer.push(bit));
        stuffer.with_last()
    }

    #[test]
    fn the_crc_has_the_check_value_of_the_catalogue() {
        let text = b"123456789".iter().fold(0, |number, byte| number << 8 | u128::from(*byte));
        assert_eq!(crc15(text), 0x059E, "CRC-15/CAN, reveng.sourceforge.io/crc-catalogue");
    }

    #[test]
    fn fields_are_at_the_positions_of_the_standard() {
        let drawn = |fields: [&str; 6]| {
            let bits = fields.concat();
            (u128::from_str_radix(&bits, 2).unwrap(), bits.len() as u32)
        };
        let standard = frame(0x555, &[0xA5]);
        assert_eq!(content(&standard), drawn(["0", "10101010101", "0", "00", "0001", "10100101"]));
        let extended = Frame::fixed(CanId::extended(0x1555_5555).unwrap(), []);
        assert_eq!(
            content(&extended),
            drawn(["0", "10101010101", "11", "010101010101010101", "000", "0000"])
        );
    }

    #[test]
    fn lengths_of_the_rigs_frames() {
        assert_eq!(frame_bits(&frame(0x080, &[])), 51, "SYNC");
        assert_eq!(unstuffed_bits(8, false), 111);
        assert_eq!(worst_case_bits(0, false), 55);
        assert_eq!(worst_case_bits(6, false), 115);
        assert_eq!(worst_case_bits(8, false), 135);
        assert_eq!(unstuffed_bits(8, true), 67 + 64);
        assert_eq!(worst_case_bits(8, true), 160);
    }

    proptest! {
        #[test]
        fn crc_and_stuffing_are_those_of_the_bit_by_bit_references(frame in any_frame()) {
            let (content, length) = content(&frame);
            let crc = reference_crc(bits_of(content, length));
            prop_assert_eq!(crc15(content), crc);
            let stuffed = reference_stuffing(bits_of(content, length).chain(bits_of(u128::from(crc), 15)));
            prop_assert_eq!(frame_bits(&frame), length + 15 + stuffed + 13);
        }

        #[test]
        fn exact_lies_between_unstuffed_and_worst_case(frame in any_frame()) {
            let (length, extended) = (frame.data().len() as u32, frame.id().is_extended());
            let exact = frame_bits(&frame);
            prop_assert!(unstuffed_bits(length, extended) <= exact);
            prop_assert!(exact <= worst_case_bits(length, extended));
        }

        #[test]
        fn a_tpdo_of_the_rig_is_within_its_bounds(node in 1_u16..=6, position: i32, torque: i16) {
            let [p0, p1, p2, p3] = position.to_le_bytes();
            let [t0, t1] = torque.to_le_bytes();
            let bits = frame_bits(&frame(0x180 + node, &[0x37, 0x12, p0, p1, p2, p3, t0, t1]));
            prop_assert!((111..=135).contains(&bits));
        }
    }
}
