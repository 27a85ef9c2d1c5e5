//! Lengths of frames in bits: the exact length from the content, and the worst case.
//!
//! The lengths are those of frames without errors. Error frames are part of [`VirtualWire`](crate::VirtualWire).

mod bitrate;
mod difference;
mod length;
mod stuffing;

pub use bitrate::{Bitrate, BitrateError};
pub(super) use difference::first_difference;
pub(super) use length::BEHIND_ACKNOWLEDGE_BITS;
pub use length::{INTERFRAME_BITS, frame_bits, unstuffed_bits, worst_case_bits};
