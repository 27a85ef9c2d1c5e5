//! What a single SDO message can carry of an object's value.

use super::{EXPEDITED, SIZED};

/// Data that one SDO message cannot carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{length} bytes: {message} SDO message carries {least} to {most}")]
pub struct SdoPayloadError {
    /// Kind of message.
    pub message: &'static str,
    /// Bytes asked for.
    pub length: usize,
    /// Bytes it carries at least.
    pub least: usize,
    /// Bytes it carries at most.
    pub most: usize,
}

/// The value in an expedited message: 1 to 4 bytes, or 4 of which the receiver must know how many count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Expedited {
    /// Bytes beyond `length` are zero.
    bytes: [u8; Self::MAX],
    length: u8,
    is_sized: bool,
}

impl Expedited {
    /// Bytes it carries at most.
    pub const MAX: usize = 4;

    /// A value of that many bytes.
    ///
    /// # Errors
    /// [`SdoPayloadError`] with none or more than 4.
    pub fn new(data: &[u8]) -> Result<Self, SdoPayloadError> {
        let error =
            SdoPayloadError { message: "an expedited", length: data.len(), least: 1, most: Self::MAX };
        if data.is_empty() {
            return Err(error);
        }
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len()).ok_or(error)?.copy_from_slice(data);
        Ok(Self { bytes, length: data.len() as u8, is_sized: true })
    }

    /// Four bytes without saying how many of them are the value.
    pub const fn of_unknown_size(bytes: [u8; Self::MAX]) -> Self {
        Self { bytes, length: Self::MAX as u8, is_sized: false }
    }

    /// The bytes; all four where the message does not tell the size.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// Whether the message tells the size.
    pub const fn is_sized(&self) -> bool {
        self.is_sized
    }

    pub(super) fn of_flags(flags: u8, bytes: [u8; Self::MAX]) -> Self {
        if flags & SIZED == 0 {
            return Self::of_unknown_size(bytes);
        }
        let unused = usize::from(flags >> 2 & 0b11);
        Self::new(&bytes[..Self::MAX - unused]).expect("two bits leave 1 to 4 bytes")
    }

    pub(super) const fn flags(self) -> u8 {
        let unused = Self::MAX as u8 - self.length;
        EXPEDITED | if self.is_sized { SIZED | unused << 2 } else { 0 }
    }

    pub(super) const fn padded(self) -> [u8; Self::MAX] {
        self.bytes
    }
}

/// The data in a segment: 0 to 7 bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Segment {
    /// Bytes beyond `length` are zero.
    bytes: [u8; Self::MAX],
    length: u8,
}

impl Segment {
    /// Bytes it carries at most.
    pub const MAX: usize = 7;

    /// A segment of that data.
    ///
    /// # Errors
    /// [`SdoPayloadError`] with more than 7 bytes.
    pub fn new(data: &[u8]) -> Result<Self, SdoPayloadError> {
        let error = SdoPayloadError { message: "a segment", length: data.len(), least: 0, most: Self::MAX };
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len()).ok_or(error)?.copy_from_slice(data);
        Ok(Self { bytes, length: data.len() as u8 })
    }

    /// The data.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    pub(super) fn of_message([command, bytes @ ..]: [u8; super::LENGTH]) -> Self {
        let unused = usize::from(command >> 1 & 0b111);
        Self::new(&bytes[..Self::MAX - unused]).expect("three bits leave 0 to 7 bytes")
    }

    pub(super) const fn flags(self) -> u8 {
        (Self::MAX as u8 - self.length) << 1
    }

    pub(super) const fn padded(self) -> [u8; Self::MAX] {
        self.bytes
    }
}
