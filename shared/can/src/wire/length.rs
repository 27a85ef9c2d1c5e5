//! Lengths of a frame in any format.

use super::bitrate::FrameBits;
use super::classical::{unstuffed_bits, wire_bits, worst_case_bits};
use super::fd::{self, unstuffed_fd_bits, worst_case_fd_bits};
use crate::frame::{Frame, FrameFormat};

/// Exact length of a frame on the wire from the start bit to the end of the interframe space.
pub fn frame_bits(frame: &Frame) -> FrameBits {
    match frame.format() {
        FrameFormat::Classical => FrameBits::nominal(wire_bits(frame)),
        FrameFormat::Fd | FrameFormat::FdBitRateSwitch => fd::bits(frame),
    }
}

/// The longest that a frame of that many data bytes can be in a format, interframe space included.
pub const fn longest_bits(data_length: u32, extended: bool, format: FrameFormat) -> FrameBits {
    match format {
        FrameFormat::Classical => FrameBits::nominal(worst_case_bits(data_length, extended)),
        FrameFormat::Fd => worst_case_fd_bits(data_length, extended, false),
        FrameFormat::FdBitRateSwitch => worst_case_fd_bits(data_length, extended, true),
    }
}

/// The shortest that a frame of that many data bytes can be in a format: without any stuff bit that depends on its
/// content, interframe space included.
pub const fn shortest_bits(data_length: u32, extended: bool, format: FrameFormat) -> FrameBits {
    match format {
        FrameFormat::Classical => FrameBits::nominal(unstuffed_bits(data_length, extended)),
        FrameFormat::Fd => unstuffed_fd_bits(data_length, extended, false),
        FrameFormat::FdBitRateSwitch => unstuffed_fd_bits(data_length, extended, true),
    }
}
