use proptest::prelude::*;

use super::*;
use crate::frame::tests::any_frame;

/// The lowest `length` bits of a field in the order of the wire, first the highest of them.
fn bits_of(field: u128, length: u32) -> impl Iterator<Item = bool> {
    (0..length).rev().map(move |bit| field >> bit & 1 == 1)
}

/// The reference: stuffing of a transmitter, bit by bit.
#[derive(Debug, Clone, Copy, Default)]
struct Stuffer {
    last: Option<bool>,
    run: u32,
    stuffed: u32,
}

impl Stuffer {
    /// Adds the next bit of the sequence, behind a stuff bit if one is due. So no stuff bit follows the last bit of a
    /// sequence.
    fn push(&mut self, bit: bool) {
        if self.run == 5 {
            (self.last, self.run) = (self.last.map(|last| !last), 1);
            self.stuffed += 1;
        }
        self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
        self.last = Some(bit);
    }

    /// The stuff bits, with the one due behind the last bit.
    fn with_last(&self) -> u32 {
        self.stuffed + u32::from(self.run == 5)
    }
}

#[test]
fn durations_are_exact_at_one_megabit_and_rounded_up_elsewhere() {
    assert_eq!(Bitrate::MAX.bits_to_ns(135), 135_000);
    assert_eq!(Bitrate::new(300_000).unwrap().bits_to_ns(1), 3334);
    assert_eq!(Bitrate::new(0), Err(BitrateError(0)));
    assert_eq!(Bitrate::new(1_000_001), Err(BitrateError(1_000_001)));
}

fn frame(id: u16, data: &[u8]) -> Frame {
    Frame::new(CanId::standard(id).unwrap(), data).unwrap()
}

/// The CRC of ISO 11898-1: a shift register.
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
    assert_eq!(content(&extended), drawn(["0", "10101010101", "11", "010101010101010101", "000", "0000"]));
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

#[test]
fn a_run_that_ends_with_the_sequence_is_stuffed_too() {
    assert_eq!(stuff_bits(0b11111, 5), 1);
    assert_eq!(stuff_bits(0b1111, 4), 0);
    assert_eq!(stuff_bits(0b1_1111_0000, 9), 2, "the stuff bit counts towards the next five");
    assert_eq!(stuff_bits(0b1_1111_0000_1111, 13), 3, "three times in a row");
    assert_eq!(stuff_bits(0, 0), 0);
}

#[test]
fn all_short_sequences_are_stuffed_as_the_transmitter_does() {
    for length in 0..=16 {
        for sequence in 0..1_u128 << length {
            let mut stuffer = Stuffer::default();
            bits_of(sequence, length).for_each(|bit| stuffer.push(bit));
            assert_eq!(stuff_bits(sequence, length), stuffer.with_last(), "{sequence:0b}");
        }
    }
}

proptest! {
    #[test]
    fn the_fast_count_is_that_of_the_transmitter(sequence: u128, mask: u128, length in 0_u32..=128) {
        // Masking makes long runs likely.
        let sequence = sequence & mask;
        let mut stuffer = Stuffer::default();
        bits_of(sequence, length).for_each(|bit| stuffer.push(bit));
        prop_assert_eq!(stuff_bits(sequence, length), stuffer.with_last());
    }
}

#[test]
fn frames_of_one_identifier_differ_first_in_length_or_data() {
    let base = frame(0x555, &[0b1010_1010, 0]);
    assert_eq!(first_difference(&base, &base), None);
    let longer = frame(0x555, &[0b1010_1010, 0, 0]);
    // Three zeros of the control field and two of the length code make a stuff bit.
    let bit = 1 + 11 + 3 + 4 + 1;
    assert_eq!(first_difference(&base, &longer), Some(Difference { bit, first_is_dominant: true }));
    let other = frame(0x555, &[0b1010_1011, 0]);
    let bit = bit + 8;
    assert_eq!(first_difference(&other, &base), Some(Difference { bit, first_is_dominant: false }));
    let run = frame(0x555, &[0b0000_0001, 0]);
    let other = frame(0x555, &[0b0000_0000, 0]);
    // So do the last zero of the length code and four of the data.
    assert_eq!(first_difference(&run, &other), Some(Difference { bit: bit + 1, first_is_dominant: false }));
}

proptest! {
    #[test]
    fn the_difference_is_where_the_transmitters_bits_differ(frame in any_frame(), other: [u8; 8]) {
        let other = Frame::new(frame.id(), &other[..frame.data().len()]).unwrap();
        let mut stuffer = Stuffer::default();
        let bits = |frame: &Frame| bits_of(content(frame).0, content(frame).1);
        let expected = (1..).zip(bits(&frame).zip(bits(&other))).find_map(|(number, (one, another))| {
            stuffer.push(one);
            let bit = number + stuffer.stuffed;
            (one != another).then_some(Difference { bit, first_is_dominant: !one })
        });
        prop_assert_eq!(first_difference(&frame, &other), expected);
    }
}
