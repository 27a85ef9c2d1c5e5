//! The first different bit of two frames with one identifier, where one of the transmitters detects an error.
//!
//! Frames with equal data have equal CRCs, so the content alone decides.

use super::length::content;
use super::stuffing::stuff_bits;
use crate::frame::Frame;

/// Where two frames of one identifier first differ on the wire, and which of them is dominant there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Difference {
    /// Number of the bit, counted from 1 with stuff bits.
    pub(crate) bit: u32,
    /// Whether the first frame sends the dominant level.
    pub(crate) first_is_dominant: bool,
}

/// Where two frames of one identifier first differ; `None` where they are the same.
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
mod tests {
    use proptest::prelude::*;

    use super::super::stuffing::reference::{Stuffer, bits_of};
    use super::*;
    use crate::frame::strategies::any_frame;
    use crate::id::CanId;

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::new(CanId::standard(id).unwrap(), data).unwrap()
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
        assert_eq!(
            first_difference(&run, &other),
            Some(Difference { bit: bit + 1, first_is_dominant: false })
        );
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
}
