//! The first different bit of two frames with one identifier, where one of the transmitters detects an error.
//!
//! Frames with equal data have equal CRCs, so the content alone decides.

use super::stuffing::Stuffer;
use super::{classical, fd};
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
    let mut stuffer = Stuffer::default();
    for (index, (one, other)) in (0..).zip(content(first).zip(content(second))) {
        stuffer.push(one);
        if one != other {
            return Some(Difference { bit: index + 1 + stuffer.stuffed, first_is_dominant: !one });
        }
    }
    // Frames of different length differ in their length codes, which lie before the data.
    None
}

/// The bits from the start bit to the last data bit, in the order of the wire.
fn content(frame: &Frame) -> impl Iterator<Item = bool> {
    let is_fd = frame.format().is_fd();
    let classical = (!is_fd).then(|| classical::content_bits(frame));
    let fd = is_fd.then(|| fd::content_bits(frame));
    classical.into_iter().flatten().chain(fd.into_iter().flatten())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::FrameFormat;
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

    #[test]
    fn formats_differ_in_fdf() {
        let classical = frame(0x555, &[1]);
        let fd = classical.promoted(FrameFormat::Fd);
        // Start bit, identifier, RTR or RRS, IDE; FDF is recessive.
        let bit = 1 + 11 + 2 + 1;
        assert_eq!(first_difference(&classical, &fd), Some(Difference { bit, first_is_dominant: true }));
        let switched = classical.promoted(FrameFormat::FdBitRateSwitch);
        let bit = bit + 2;
        assert_eq!(first_difference(&switched, &fd), Some(Difference { bit, first_is_dominant: false }));
    }

    #[test]
    fn long_frames_may_differ_in_their_last_bit() {
        let fd = |last| {
            let mut data = [0x55; Frame::MAX_DATA];
            data[Frame::MAX_DATA - 1] = last;
            Frame::with_format(frame(0x555, &[]).id(), FrameFormat::Fd, &data).unwrap()
        };
        let unstuffed = 17 + 5 + 8 * 64;
        let difference = Difference { bit: unstuffed, first_is_dominant: true };
        assert_eq!(first_difference(&fd(0x54), &fd(0x55)), Some(difference));
        assert_eq!(first_difference(&fd(0x55), &fd(0x55)), None);
    }
}
