//! The data bytes of a CAN frame in a message of fixed size: a CDR sequence with room for the longest.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use masseter_can::Frame;

use super::schema::FieldType;

const MOST: usize = Frame::MAX_DATA;

/// Data bytes, as CDR writes a sequence: how many, then they themselves. Unused ones are zero.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable, ZeroCopySend)]
pub struct CanData {
    /// Number of bytes in use.
    pub length: u32,
    /// The bytes in use, then zeros.
    pub bytes: [u8; MOST],
}

impl CanData {
    /// The first `length` of these bytes; those behind must be zero.
    pub fn padded(bytes: [u8; MOST], length: usize) -> Self {
        Self { length: length as u32, bytes }
    }

    /// The bytes in use.
    pub fn as_slice(&self) -> &[u8] {
        &self.bytes[..MOST - self.unused_bytes()]
    }
}

impl FieldType for CanData {
    fn ros_type() -> String {
        format!("{}[<={MOST}]", u8::ros_type())
    }

    fn unused_bytes(&self) -> usize {
        MOST.saturating_sub(self.length as usize)
    }
}
