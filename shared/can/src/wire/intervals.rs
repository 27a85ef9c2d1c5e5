//! Bits that follow the acknowledgement of every frame.

/// Pause after a frame before the next may start.
pub const INTERFRAME_BITS: u32 = 3;
/// Acknowledge delimiter and end of frame.
pub(crate) const BEHIND_ACKNOWLEDGE_BITS: u32 = 1 + 7;
