//! The header before the body of every message.

/// Encapsulation header of plain little-endian CDR (version 1, OMG CDR).
pub const CDR_LITTLE_ENDIAN: [u8; 4] = [0x00, 0x01, 0x00, 0x00];
