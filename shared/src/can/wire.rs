//! What a frame costs on the wire: its exact length in bits, from its content, and its worst case.
//!
//! Classical CAN (ISO 11898-1) without errors: neither error frames nor overload frames are counted.

use super::frame::{CanId, Frame};

/// CRC delimiter, acknowledge slot and delimiter, end of frame.
const TRAILER_BITS: u32 = 1 + 2 + 7;
/// Pause after a frame before the next may start.
pub const INTERFRAME_BITS: u32 = 3;
const CRC_BITS: u32 = 15;
const CRC_POLYNOMIAL: u16 = 0x4599;
const CRC_MASK: u16 = (1 << CRC_BITS) - 1;
const CRC_TABLE: [u16; 256] = crc_table();
const STANDARD_HEADER_BITS: u32 = 19;
const EXTENDED_HEADER_BITS: u32 = 39;

/// Exact length of a frame on the wire from the start bit to the end of the interframe space, bits.
pub fn wire_bits(frame: &Frame) -> u32 {
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
fn content(frame: &Frame) -> (u128, u32) {
    let length = frame.data().len() as u32;
    let data = u64::from_be_bytes(frame.padded());
    let bits = 8 * length;
    let shifted_data = u128::from(data) >> (64 - bits);
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

/// CRC of the content. The zeros above it do not matter, as the CRC starts from zero.
fn crc15(content: u128) -> u16 {
    content.to_be_bytes().into_iter().fold(0, |crc, byte| {
        let index = (crc >> (CRC_BITS - 8)) as u8 ^ byte;
        (crc << 8 ^ CRC_TABLE[usize::from(index)]) & CRC_MASK
    })
}

const fn crc_table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < table.len() {
        let mut crc = (byte as u16) << (CRC_BITS - 8);
        let mut bit = 0;
        while bit < 8 {
            let carry = crc >> (CRC_BITS - 1) & 1 == 1;
            crc = crc << 1 & CRC_MASK;
            if carry {
                crc ^= CRC_POLYNOMIAL;
            }
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
}

/// Stuff bits that a sequence gets: after five equal bits, one of the other level, which itself counts
/// towards the next five.
fn stuff_bits(sequence: u128, length: u32) -> u32 {
    let mut left = sequence << (u128::BITS - length);
    let mut length = length;
    let mut stuffed = 0;
    loop {
        let five_equal_end = starts_of_five_equal(left).leading_zeros() + 5;
        if five_equal_end > length {
            return stuffed;
        }
        // Go on behind the five, with the stuff bit in place of the fifth.
        stuffed += 1;
        left = (left << (five_equal_end - 1)) ^ (1 << (u128::BITS - 1));
        length -= five_equal_end - 1;
    }
}

/// A bit set wherever the four bits that follow are equal to it.
const fn starts_of_five_equal(bits: u128) -> u128 {
    let two = !(bits ^ (bits << 1));
    let three = two & (two << 1);
    three & (three << 2)
}

/// A bit rate that is none of classical CAN.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("bit rate {bps} bit/s is outside classical CAN (1 to 1000000 bit/s)")]
pub struct BitrateError {
    /// Bit rate asked for, bit/s.
    pub bps: u32,
}

/// Bit rate of a bus, 1 to 1 000 000 bit/s.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bitrate {
    bps: u32,
}

impl Bitrate {
    /// The fastest of classical CAN, 1 Mbit/s.
    pub const MAX: Self = Self { bps: 1_000_000 };

    /// That many bits a second.
    ///
    /// # Errors
    /// [`BitrateError`] for 0 and for more than 1 Mbit/s.
    pub const fn new(bps: u32) -> Result<Self, BitrateError> {
        if bps == 0 || bps > Self::MAX.bps { Err(BitrateError { bps }) } else { Ok(Self { bps }) }
    }

    /// Bits a second.
    pub const fn bps(self) -> u32 {
        self.bps
    }

    /// Duration of that many bits, rounded up, ns.
    pub const fn bits_to_ns(self, bits: u32) -> u64 {
        (bits as u64 * 1_000_000_000).div_ceil(self.bps as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::super::frame::strategies::any_frame;
    use super::*;
    use proptest::prelude::*;

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::new(CanId::standard(id).unwrap(), data).unwrap()
    }

    /// The bits in the order of the wire, one by one.
    fn bits_of(number: u128, length: u32) -> impl Iterator<Item = bool> {
        (0..length).rev().map(move |bit| number >> bit & 1 == 1)
    }

    /// The CRC as ISO 11898-1 writes it: a shift register.
    fn reference_crc(bits: impl Iterator<Item = bool>) -> u16 {
        bits.fold(0, |crc: u16, bit| {
            let shifted = crc << 1 & 0x7FFF;
            if bit ^ (crc >> 14 & 1 == 1) { shifted ^ 0x4599 } else { shifted }
        })
    }

    /// Stuffing as a transmitter does it: count equal bits, insert at five.
    fn reference_stuffing(bits: impl Iterator<Item = bool>) -> u32 {
        let (mut last, mut run, mut stuffed) = (None, 0, 0);
        for bit in bits {
            run = if last == Some(bit) { run + 1 } else { 1 };
            last = Some(bit);
            if run == 5 {
                (last, run) = (Some(!bit), 1);
                stuffed += 1;
            }
        }
        stuffed
    }

    #[test]
    fn the_crc_has_the_check_value_of_the_catalogue() {
        let text = b"123456789".iter().fold(0, |number, byte| number << 8 | u128::from(*byte));
        assert_eq!(crc15(text), 0x059E, "CRC-15/CAN, reveng.sourceforge.io/crc-catalogue");
    }

    #[test]
    fn fields_lie_where_the_standard_draws_them() {
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
        assert_eq!(wire_bits(&frame(0x080, &[])), 51, "SYNC");
        assert_eq!(unstuffed_bits(8, false), 111);
        assert_eq!(worst_case_bits(0, false), 55);
        assert_eq!(worst_case_bits(6, false), 115);
        assert_eq!(worst_case_bits(8, false), 135);
        assert_eq!(unstuffed_bits(8, true), 67 + 64);
        assert_eq!(worst_case_bits(8, true), 160);
    }

    #[test]
    fn durations_are_exact_at_one_megabit_and_rounded_up_elsewhere() {
        assert_eq!(Bitrate::MAX.bits_to_ns(135), 135_000);
        assert_eq!(Bitrate::new(300_000).unwrap().bits_to_ns(1), 3334);
        assert_eq!(Bitrate::new(0), Err(BitrateError { bps: 0 }));
        assert_eq!(Bitrate::new(1_000_001), Err(BitrateError { bps: 1_000_001 }));
    }

    #[test]
    fn a_run_that_ends_with_the_sequence_is_stuffed_too() {
        assert_eq!(stuff_bits(0b11111, 5), 1);
        assert_eq!(stuff_bits(0b1111, 4), 0);
        assert_eq!(stuff_bits(0b1_1111_0000, 9), 2, "the stuff bit counts towards the next five");
    }

    proptest! {
        #[test]
        fn crc_and_stuffing_are_those_of_the_bit_by_bit_references(frame in any_frame()) {
            let (content, length) = content(&frame);
            let crc = reference_crc(bits_of(content, length));
            prop_assert_eq!(crc15(content), crc);
            let stuffed = reference_stuffing(bits_of(content, length).chain(bits_of(u128::from(crc), 15)));
            prop_assert_eq!(wire_bits(&frame), length + 15 + stuffed + 13);
        }

        #[test]
        fn exact_lies_between_unstuffed_and_worst_case(frame in any_frame()) {
            let (length, extended) = (frame.data().len() as u32, frame.id().is_extended());
            let exact = wire_bits(&frame);
            prop_assert!(unstuffed_bits(length, extended) <= exact);
            prop_assert!(exact <= worst_case_bits(length, extended));
        }

        #[test]
        fn a_tpdo_of_the_rig_is_within_its_bounds(node in 1_u16..=6, position: i32, torque: i16) {
            let [p0, p1, p2, p3] = position.to_le_bytes();
            let [t0, t1] = torque.to_le_bytes();
            let bits = wire_bits(&frame(0x180 + node, &[0x37, 0x12, p0, p1, p2, p3, t0, t1]));
            prop_assert!((111..=135).contains(&bits));
        }
    }
}
