//! Lengths of CAN FD frames (ISO 11898-1:2015).
//!
//! The data phase lies between the sample points of BRS and of the CRC delimiter; with the same sample point
//! in both phases that is as if BRS went wholly at the nominal rate and the CRC delimiter wholly at the data
//! rate, which is how they are counted here. The CRC field has fixed stuff bits, so that its length
//! depends on the data length alone, not on the CRC: the values of CRC-17 and CRC-21 are not computed.

use super::bitrate::FrameBits;
use super::intervals::{BEHIND_ACKNOWLEDGE_BITS, INTERFRAME_BITS};
use super::stuffing::{Stuffer, bits_of};
use crate::frame::{Frame, FrameFormat};
use crate::id::CanId;

/// From the start bit to BRS.
const STANDARD_HEAD_BITS: u32 = 17;
const EXTENDED_HEAD_BITS: u32 = 36;
/// Error state indicator and data length code.
const CONTROL_BITS: u32 = 1 + 4;
const STUFF_COUNT_BITS: u32 = 4;
const CRC_DELIMITER_BITS: u32 = 1;
const ACKNOWLEDGE_BITS: u32 = 1;
/// Longest data that CRC-17 protects, bytes; CRC-21 protects the others.
const CRC_17_LENGTH: u32 = 16;

/// Exact length of a frame in FD format.
pub(super) fn bits(frame: &Frame) -> FrameBits {
    let head_bits = head_bits(frame.id().is_extended());
    let (mut stuffer, mut content) = (Stuffer::default(), content_bits(frame));
    content.by_ref().take(head_bits as usize).for_each(|bit| stuffer.push(bit));
    let head_stuffed = stuffer.stuffed;
    content.for_each(|bit| stuffer.push(bit));
    let stuffed = stuffer.stuffed - head_stuffed;
    lay_out(switches(frame), head_bits + head_stuffed, stuffed, frame.data().len() as u32)
}

/// The bits from the start bit to the last data bit, in the order of the wire.
pub(super) fn content_bits(frame: &Frame) -> impl Iterator<Item = bool> {
    let id = frame.id();
    let head = bits_of(head(id, switches(frame)).into(), head_bits(id.is_extended()));
    let control = bits_of(u128::from(frame.length_code()), CONTROL_BITS);
    head.chain(control).chain(frame.data().iter().flat_map(|&byte| bits_of(u128::from(byte), 8)))
}

fn switches(frame: &Frame) -> bool {
    frame.format() == FrameFormat::FdBitRateSwitch
}

/// Length of an FD frame of that many data bytes with no stuff bits but the fixed ones.
pub(super) const fn unstuffed_fd_bits(data_length: u32, extended: bool, switches: bool) -> FrameBits {
    lay_out(switches, head_bits(extended), 0, data_length)
}

/// The longest that an FD frame of that many data bytes can be.
pub(super) const fn worst_case_fd_bits(data_length: u32, extended: bool, switches: bool) -> FrameBits {
    let head = head_bits(extended);
    let content = head + CONTROL_BITS + 8 * data_length;
    // As with classical frames, but the bit behind which a stuff bit would be due must have a successor.
    let head_stuffed = (head - 2) / 4;
    lay_out(switches, head + head_stuffed, (content - 2) / 4 - head_stuffed, data_length)
}

const fn head_bits(extended: bool) -> u32 {
    if extended { EXTENDED_HEAD_BITS } else { STANDARD_HEAD_BITS }
}

/// Start bit to BRS. Start, RRS and the reserved bit are 0, FDF is 1.
fn head(id: CanId, switches: bool) -> u64 {
    const SRR_AND_IDE: u64 = 0b11;
    let base = u64::from(id.base());
    let arbitration = if id.is_extended() {
        ((base << 2 | SRR_AND_IDE) << 18 | u64::from(id.extension())) << 1
    } else {
        base << 2
    };
    arbitration << 3 | 0b100 | u64::from(switches)
}

const fn lay_out(switches: bool, head: u32, stuffed: u32, data_length: u32) -> FrameBits {
    let crc = if data_length <= CRC_17_LENGTH { 17 } else { 21 };
    // One before the stuff count, one behind every four bits that have a successor.
    let fixed = (STUFF_COUNT_BITS + crc).div_ceil(4);
    let data = CONTROL_BITS + 8 * data_length + stuffed + STUFF_COUNT_BITS + crc + fixed + CRC_DELIMITER_BITS;
    let tail = ACKNOWLEDGE_BITS + BEHIND_ACKNOWLEDGE_BITS + INTERFRAME_BITS;
    if switches { FrameBits { head, data, tail } } else { FrameBits::nominal(head + data + tail) }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::strategies::any_fd_frame;

    fn frame(id: u16, format: FrameFormat, data: &[u8]) -> Frame {
        Frame::with_format(CanId::standard(id).unwrap(), format, data).unwrap()
    }

    #[test]
    fn unstuffed_lengths_are_those_that_the_kernel_counts() {
        // linux/can/length.h: 62 bits with CRC-17 and 67 with CRC-21, data excluded; 19 more with 29-bit identifiers.
        let total = |id, length| {
            let frame = Frame::with_format(id, FrameFormat::FdBitRateSwitch, &vec![0x55; length]).unwrap();
            bits(&frame).total()
        };
        let standard = CanId::standard(0x555).unwrap();
        assert_eq!(total(standard, 8), 62 + 64);
        assert_eq!(total(standard, 16), 62 + 128);
        assert_eq!(total(standard, 64), 67 + 512);
        assert_eq!(total(CanId::extended(0x1555_5555).unwrap(), 8), 62 + 64 + 19);
    }

    #[test]
    fn the_data_phase_begins_behind_brs_and_ends_with_the_crc_delimiter() {
        let switched = bits(&frame(0x555, FrameFormat::FdBitRateSwitch, &[0x55; 8]));
        assert_eq!(switched, FrameBits { head: 17, data: 5 + 64 + 4 + 17 + 6 + 1, tail: 12 });
        let unswitched = bits(&frame(0x555, FrameFormat::Fd, &[0x55; 8]));
        assert_eq!(unswitched, FrameBits::nominal(switched.total()));
    }

    #[test]
    fn no_stuff_bit_precedes_the_fixed_one() {
        let total = |data: u8| bits(&frame(0x555, FrameFormat::FdBitRateSwitch, &[data])).total();
        assert_eq!(total(0b0101_1111), total(0b0101_0101));
    }

    proptest! {
        #[test]
        fn exact_is_within_shortest_and_worst_case(frame in any_fd_frame()) {
            let (length, extended) = (frame.data().len() as u32, frame.id().is_extended());
            let (exact, worst) = (bits(&frame), worst_case_fd_bits(length, extended, switches(&frame)));
            prop_assert!(exact.head <= worst.head && exact.total() <= worst.total(), "{exact:?} {worst:?}");
            let shortest = unstuffed_fd_bits(length, extended, switches(&frame));
            let crc_and_fixed = if length <= 16 { 17 + 6 } else { 21 + 7 };
            prop_assert_eq!(shortest.total(), head_bits(extended) + 5 + 8 * length + 4 + crc_and_fixed + 1 + 12);
            prop_assert!(shortest.head <= exact.head && shortest.data <= exact.data, "{exact:?} {shortest:?}");
        }
    }
}
