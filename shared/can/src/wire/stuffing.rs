//! Bit stuffing: after five equal bits, one of the other level, which itself counts towards the next
//! five (ISO 11898-1, 10.5).

/// Stuff bits that the lowest `length` bits of `sequence` get, first the highest of them; one that is due
/// behind the last bit is counted.
pub(super) fn stuff_bits(sequence: u128, length: u32) -> u32 {
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

#[cfg(test)]
pub(super) mod reference {
    /// The lowest `length` bits of a field in the order of the wire, first the highest of them.
    pub(in crate::wire) fn bits_of(field: u128, length: u32) -> impl Iterator<Item = bool> {
        (0..length).rev().map(move |bit| field >> bit & 1 == 1)
    }

    /// Stuffing as a transmitter does it, bit by bit: the reference.
    #[derive(Debug, Clone, Copy, Default)]
    pub(in crate::wire) struct Stuffer {
        last: Option<bool>,
        run: u32,
        pub(in crate::wire) stuffed: u32,
    }

    impl Stuffer {
        /// The next bit of the sequence. A stuff bit that is due is inserted before it, so that none
        /// follows the last bit of a sequence.
        pub(in crate::wire) fn push(&mut self, bit: bool) {
            if self.run == 5 {
                (self.last, self.run) = (self.last.map(|last| !last), 1);
                self.stuffed += 1;
            }
            self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
            self.last = Some(bit);
        }

        /// The stuff bits with the one that is due behind the last bit.
        pub(in crate::wire) fn with_last(&self) -> u32 {
            self.stuffed + u32::from(self.run == 5)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::reference::{Stuffer, bits_of};
    use super::*;
    use proptest::prelude::*;

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
}
