//! The data bytes of a CAN frame in a message of fixed size: a CDR sequence with room for the longest.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;
use masseter_can::Frame;

use super::schema::FieldType;

/// Room for the frames of other formats too.
const MOST: usize = 64;

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
    /// The data of a frame.
    ///
    /// # Panics
    /// With more bytes than there is room for.
    pub fn new(data: &[u8]) -> Self {
        let mut bytes = [0; MOST];
        bytes[..data.len()].copy_from_slice(data);
        Self { length: data.len() as u32, bytes }
    }

    /// The data of a classic frame.
    pub fn of_frame(frame: &Frame) -> Self {
        let mut bytes = [0; MOST];
        bytes[..Frame::MAX_DATA].copy_from_slice(frame.padded());
        Self { length: frame.data().len() as u32, bytes }
    }

    /// The data of a frame; none with more bytes than there is room for.
    pub fn checked(data: &[u8]) -> Option<Self> {
        (data.len() <= MOST).then(|| Self::new(data))
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
