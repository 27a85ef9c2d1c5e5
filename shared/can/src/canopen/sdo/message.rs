//! The parts that requests and responses share.

use super::abort::AbortCode;
use super::object::ObjectAddress;
use super::payload::{EXPEDITED, Expedited, LENGTH, SIZED, Segment};
use crate::canopen::LengthError;

/// The toggle bit of segment messages.
pub(super) const TOGGLE: u8 = 1 << 4;
/// "No more segments", in segment messages with data.
pub(super) const LAST: u8 = 1 << 0;
/// Abort, in both directions.
pub(super) const ABORT: u8 = 4;

/// Data that is not an SDO message of this direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// Wrong length.
    #[error(transparent)]
    Length(#[from] LengthError),
    /// An unsupported command specifier; a server aborts with
    /// [`AbortCode::UNKNOWN_COMMAND`].
    #[error(
        "command {command:02X}h for {object} is not a supported SDO service (block transfer is not supported)"
    )]
    UnknownCommand {
        /// The first byte.
        command: u8,
        /// The bytes at the place of the object.
        object: ObjectAddress,
    },
}

/// The command specifier, the top three bits of the first byte.
pub(super) const fn specifier(command: u8) -> u8 {
    command >> 5
}

/// A message of a command specifier with its flags, an object and four bytes.
pub(super) fn initiate(specifier: u8, flags: u8, object: ObjectAddress, data: [u8; 4]) -> [u8; LENGTH] {
    let [index_low, index_high] = object.index.to_le_bytes();
    let [d0, d1, d2, d3] = data;
    [specifier << 5 | flags, index_low, index_high, object.subindex, d0, d1, d2, d3]
}

/// A message of a command specifier with its toggle bit and a segment's flags and data.
pub(super) fn segment(specifier: u8, toggle: bool, data: Option<(&Segment, bool)>) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    bytes[0] = specifier << 5 | if toggle { TOGGLE } else { 0 };
    if let Some((segment, is_last)) = data {
        bytes[0] |= segment.flags() | if is_last { LAST } else { 0 };
        bytes[1..].copy_from_slice(&segment.bytes);
    }
    bytes
}

/// The size of a transfer in an initiate message: flags and data.
pub(super) const fn size_field(size: Option<u32>) -> (u8, [u8; 4]) {
    match size {
        Some(size) => (SIZED, size.to_le_bytes()),
        None => (0, [0; 4]),
    }
}

/// The parts of a message that begins with an object.
pub(super) struct Initiate {
    pub(super) command: u8,
    pub(super) object: ObjectAddress,
    data: [u8; 4],
}

impl Initiate {
    pub(super) const fn parse([command, i0, i1, subindex, d0, d1, d2, d3]: [u8; LENGTH]) -> Self {
        let object = ObjectAddress { index: u16::from_le_bytes([i0, i1]), subindex };
        Self { command, object, data: [d0, d1, d2, d3] }
    }

    pub(super) const fn is_expedited(&self) -> bool {
        self.command & EXPEDITED != 0
    }

    pub(super) fn expedited(&self) -> Expedited {
        Expedited::from_flags(self.command, self.data)
    }

    pub(super) fn size(&self) -> Option<u32> {
        (self.command & SIZED != 0).then_some(u32::from_le_bytes(self.data))
    }

    pub(super) const fn abort_code(&self) -> AbortCode {
        AbortCode(u32::from_le_bytes(self.data))
    }

    pub(super) const fn unknown(&self) -> SdoError {
        SdoError::UnknownCommand { command: self.command, object: self.object }
    }
}
