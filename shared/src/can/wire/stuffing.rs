//! Bit stuffing: after five equal bits, one of the other level, which itself counts towards the next
//! five (ISO 11898-1, 10.5).

/// Stuff bits that the lowest `length` bits of `sequence` get, first the highest of them.
pub(super) fn stuff_bits(sequence: u128, length: u32) -> u32 {
    let Some(shift) = u128::BITS.checked_sub(length).filter(|&shift| shift < u128::BITS) else { return 0 };
    let mut left = sequence << shift;
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

/// Stuffing as a transmitter does it, bit by bit: for sequences of any length.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stuffer {
    last: Option<bool>,
    run: u32,
    /// Stuff bits inserted so far.
    pub(super) stuffed: u32,
}

impl Stuffer {
    /// The next bit of the sequence. A stuff bit that is due is inserted before it, so that none
    /// follows the last bit of a sequence.
    pub(super) fn push(&mut self, bit: bool) {
        if self.run == 5 {
            (self.last, self.run) = (self.last.map(|last| !last), 1);
            self.stuffed += 1;
        }
        self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
        self.last = Some(bit);
    }

    /// The stuff bits with the one that is due behind the last bit.
    #[cfg(test)]
    pub(super) fn with_last(&self) -> u32 {
        self.stuffed + u32::from(self.run == 5)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_run_that_ends_with_the_sequence_is_stuffed_too() {
        assert_eq!(stuff_bits(0b11111, 5), 1);
        assert_eq!(stuff_bits(0b1111, 4), 0);
        assert_eq!(stuff_bits(0b1_1111_0000, 9), 2, "the stuff bit counts towards the next five");
        assert_eq!(stuff_bits(0, 0), 0);
    }

    proptest! {
        #[test]
        fn the_fast_count_is_that_of_the_transmitter(sequence: u128, mask: u128, length in 0_u32..=128) {
            // Masking makes long runs likely.
            let sequence = sequence & mask;
            let mut stuffer = Stuffer::default();
            (0..length).rev().for_each(|bit| stuffer.push(sequence >> bit & 1 == 1));
            prop_assert_eq!(stuff_bits(sequence, length), stuffer.with_last());
        }
    }
}
