//! Service data objects (CiA 301, 7.2.4): one entry of a node's object dictionary read or written,
//! confirmed, expedited (at most 4 bytes) or in segments of 7.
//!
//! Codecs only: [`SdoRequest`] is what a client sends, [`SdoResponse`] what a server answers, both
//! always eight bytes. The order of a transfer, its toggle bits and its time-outs are kept by client
//! and server. Block transfer and network indication are not represented.

mod abort;
mod object;
mod payload;
mod request;
mod response;
#[cfg(test)]
mod tests;

pub use abort::AbortCode;
pub use object::ObjectAddress;
pub use payload::{Expedited, SdoPayloadError, Segment};
pub use request::SdoRequest;
pub use response::SdoResponse;

use super::LengthError;

/// Bytes of every SDO message.
const LENGTH: usize = 8;

/// The toggle bit of segment messages.
const TOGGLE: u8 = 1 << 4;
/// "No more segments", in segment messages with data.
const LAST: u8 = 1 << 0;
/// "Size indicated", in initiate messages.
const SIZED: u8 = 1 << 0;
/// "Expedited transfer", in initiate messages.
const EXPEDITED: u8 = 1 << 1;
/// Abort, in both directions.
const ABORT: u8 = 4;

/// Data that is no SDO message of this direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// Wrong length.
    #[error(transparent)]
    Length(#[from] LengthError),
    /// A command specifier that is not known here; a server aborts with
    /// [`AbortCode::UNKNOWN_COMMAND`].
    #[error("command {command:02X}h for {object} is no SDO service known here (block transfer is not)")]
    UnknownCommand {
        /// The first byte.
        command: u8,
        /// What stands where most messages have the object.
        object: ObjectAddress,
    },
}

/// The command specifier, the top three bits of the first byte.
const fn specifier(command: u8) -> u8 {
    command >> 5
}

/// A message of a command specifier with its flags, an object and four bytes.
fn initiate(specifier: u8, flags: u8, object: ObjectAddress, data: [u8; 4]) -> [u8; LENGTH] {
    let [index_low, index_high] = object.index.to_le_bytes();
    let [d0, d1, d2, d3] = data;
    [specifier << 5 | flags, index_low, index_high, object.subindex, d0, d1, d2, d3]
}

/// A message of a command specifier with its toggle bit and a segment's flags and data.
fn segment(specifier: u8, toggle: bool, data: Option<(&Segment, bool)>) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    bytes[0] = specifier << 5 | if toggle { TOGGLE } else { 0 };
    if let Some((segment, is_last)) = data {
        bytes[0] |= segment.flags() | if is_last { LAST } else { 0 };
        bytes[1..].copy_from_slice(&segment.padded());
    }
    bytes
}

/// The size of a transfer in an initiate message: flags and data.
const fn size_field(size: Option<u32>) -> (u8, [u8; 4]) {
    match size {
        Some(size) => (SIZED, size.to_le_bytes()),
        None => (0, [0; 4]),
    }
}

/// The parts of a message that begins with an object.
struct Initiate {
    command: u8,
    object: ObjectAddress,
    data: [u8; 4],
}

impl Initiate {
    const fn of([command, i0, i1, subindex, d0, d1, d2, d3]: [u8; LENGTH]) -> Self {
        let object = ObjectAddress { index: u16::from_le_bytes([i0, i1]), subindex };
        Self { command, object, data: [d0, d1, d2, d3] }
    }

    const fn is_expedited(&self) -> bool {
        self.command & EXPEDITED != 0
    }

    fn expedited(&self) -> Expedited {
        Expedited::of_flags(self.command, self.data)
    }

    fn size(&self) -> Option<u32> {
        (self.command & SIZED != 0).then_some(u32::from_le_bytes(self.data))
    }

    const fn abort_code(&self) -> AbortCode {
        AbortCode(u32::from_le_bytes(self.data))
    }

    const fn unknown(&self) -> SdoError {
        SdoError::UnknownCommand { command: self.command, object: self.object }
    }
}
