//! Bit stuffing: after five equal bits, one of the other level, which itself counts towards the next
//! five (ISO 11898-1, 10.5).

/// Stuff bits that the lowest `length` bits of `sequence` get, first the highest of them; one that is due
/// behind the last bit is counted.
pub(super) fn stuff_bits(sequence: u128, length: u32) -> u32 {
    if length == 0 {
        return 0;
    }
    // Alternating bits before the first get no stuff bit and fill up the number.
    let begins_recessive = sequence >> (length - 1) & 1 == 1;
    let alternating = if begins_recessive { u128::MAX / 3 * 2 } else { u128::MAX / 3 };
    let content = sequence & u128::MAX >> (u128::BITS - length);
    let filled = alternating.unbounded_shl(length) | content;
    let mut run = Run::of_one_bit(filled.leading_zeros() > 0);
    let mut stuffed = 0;
    // A whole byte of alternating bits ends in the run that it began with.
    let alternating_bytes = (u128::BITS - length) as usize / 8;
    for byte in &filled.to_be_bytes()[alternating_bytes..] {
        let (next, inserted) = STEPS[usize::from(run.0)][usize::from(*byte)];
        run = next;
        stuffed += u32::from(inserted);
    }
    stuffed
}

/// The equal bits at the end of the sequence: one to four, since the fifth brings its stuff bit at once. The value is the
/// number of bits − 1, plus 4 for recessive bits.
#[derive(Debug, Clone, Copy)]
struct Run(u8);

impl Run {
    const COUNT: usize = 8;
    const RECESSIVE: u8 = 4;
    const LONGEST: u8 = 3;

    const fn of_one_bit(recessive: bool) -> Self {
        Self(if recessive { Self::RECESSIVE } else { 0 })
    }

    const fn is_recessive(self) -> bool {
        self.0 & Self::RECESSIVE != 0
    }

    /// The run after one more bit, and the stuff bits inserted.
    const fn push(self, recessive: bool) -> (Self, u8) {
        if recessive != self.is_recessive() {
            (Self::of_one_bit(recessive), 0)
        } else if self.0 & Self::LONGEST == Self::LONGEST {
            (Self::of_one_bit(!recessive), 1)
        } else {
            (Self(self.0 + 1), 0)
        }
    }

    /// The run after eight more bits, and the stuff bits inserted.
    const fn push_byte(self, byte: u8) -> (Self, u8) {
        let (mut run, mut total, mut bit) = (self, 0, 8);
        while bit > 0 {
            bit -= 1;
            let (next, stuffed) = run.push(byte >> bit & 1 == 1);
            run = next;
            total += stuffed;
        }
        (run, total)
    }
}

/// For every run and every byte that follows it: the run at the end of the byte, and the stuff bits inserted.
static STEPS: [[(Run, u8); 256]; Run::COUNT] = {
    let mut steps = [[(Run(0), 0); 256]; Run::COUNT];
    let mut run = 0;
    while run < Run::COUNT {
        let mut byte = 0;
        while byte < 256 {
            steps[run][byte] = Run(run as u8).push_byte(byte as u8);
            byte += 1;
        }
        run += 1;
    }
    steps
};

#[cfg(test)]
pub(super) mod reference {
    /// The lowest `length` bits of a field in the order of the wire, first the highest of them.
    pub(in crate::wire) fn bits_of(field: u128, length: u32) -> impl Iterator<Item = bool> {
        (0..length).rev().map(move |bit| field >> bit & 1 == 1)
    }

    /// Stuffing as a transmitter does it, bit by bit: the reference for the table.
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
        assert_eq!(stuff_bits(0, 0), 0);
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
