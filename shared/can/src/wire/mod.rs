//! Lengths of frames in bits: the exact length from the content, and the worst case.
//!
//! The lengths are those of frames without errors. Error frames are part of [`VirtualWire`](crate::VirtualWire).

mod bitrate;
mod classical;
mod difference;
mod fd;
mod intervals;
mod length;
mod stuffing;

pub use bitrate::{Bitrate, BitrateError, FrameBits, Rates};
pub use classical::{unstuffed_bits, worst_case_bits};
pub(super) use difference::first_difference;
pub(super) use intervals::BEHIND_ACKNOWLEDGE_BITS;
pub use intervals::INTERFRAME_BITS;
pub use length::{frame_bits, longest_bits, shortest_bits};
