//! What a frame costs on the wire: its exact length in bits, from its content, and its worst case.
//!
//! Frames without errors; what an error frame adds is up to the wire it happens on.

mod bitrate;
mod classical;
mod difference;
mod fd;
mod stuffing;

use super::frame::{Frame, FrameFormat};

pub use bitrate::{Bitrate, BitrateError, FrameBits, Rates};
use classical::wire_bits;
pub use classical::{unstuffed_bits, worst_case_bits};
pub(super) use difference::first_difference;
use fd::{unstuffed_fd_bits, worst_case_fd_bits};

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

/// Pause after a frame before the next may start.
pub const INTERFRAME_BITS: u32 = 3;
/// Acknowledge delimiter and end of frame.
pub(super) const BEHIND_ACKNOWLEDGE_BITS: u32 = 1 + 7;
