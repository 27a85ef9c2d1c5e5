//! Service data objects (CiA 301, 7.2.4): a confirmed read or write of one entry of a node's object dictionary. A
//! transfer is expedited (at most 4 bytes) or in segments of 7.
//!
//! A client sends an [`SdoRequest`], a server answers with an [`SdoResponse`]; both have eight bytes. This module only
//! encodes and decodes: client and server keep the order of a transfer, its toggle bits and its time-outs. Network
//! indication is not represented. The messages of block transfer are a type of their own, [`BlockMessage`].

use std::fmt;

use super::{Cob, LengthError, NodeId, ObjectAddress, exactly};
use crate::frame::Frame;

mod block;
#[cfg(test)]
mod tests;

pub use block::{BlockMessage, BlockSegment, block_crc};

/// Bytes of every SDO message.
const LENGTH: usize = 8;
/// "Size indicated", in initiate messages.
const SIZED: u8 = 1 << 0;
/// "Expedited transfer", in initiate messages.
const EXPEDITED: u8 = 1 << 1;
/// The toggle bit of segment messages.
const TOGGLE: u8 = 1 << 4;
/// "No more segments", in segment messages with data.
const LAST: u8 = 1 << 0;
/// Command specifier of an abort, in both directions.
const ABORT: u8 = 4;

/// A request to the SDO server of a node.
///
/// # Examples
/// Writes 1 to object 1400h:02h of node 5:
///
/// ```
/// use masseter_can::canopen::{Expedited, NodeId, ObjectAddress, SdoRequest};
///
/// let object = ObjectAddress::new(0x1400, 2);
/// let request = SdoRequest::Download { object, data: Expedited::new(&[1]).expect("1 to 4 bytes") };
/// let frame = request.frame(NodeId::new(5)?);
/// assert_eq!(frame.to_string(), "605#2F00140201000000");
/// assert_eq!(SdoRequest::decode(frame.data())?, request);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdoRequest {
    /// Write an object of at most 4 bytes (2Xh).
    Download {
        /// The object.
        object: ObjectAddress,
        /// Its value.
        data: Expedited,
    },
    /// Begin to write an object in segments (20h, 21h).
    InitiateDownload {
        /// The object.
        object: ObjectAddress,
        /// Number of bytes that follow, if known.
        size: Option<u32>,
    },
    /// The next bytes to write (0Xh, 1Xh).
    DownloadSegment {
        /// Alternates, beginning with `false`.
        toggle: bool,
        /// The bytes.
        data: Segment,
        /// Whether this segment is the last.
        is_last: bool,
    },
    /// Read an object (40h).
    InitiateUpload {
        /// The object.
        object: ObjectAddress,
    },
    /// Read the next bytes (60h, 70h).
    UploadSegment {
        /// Alternates, beginning with `false`.
        toggle: bool,
    },
    /// End the transfer with an error (80h).
    Abort {
        /// The transfer's object.
        object: ObjectAddress,
        /// The reason.
        code: AbortCode,
    },
}

/// An answer of a node's SDO server.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdoResponse {
    /// The object was written, or its segments may come (60h).
    Download {
        /// The object.
        object: ObjectAddress,
    },
    /// The segment was taken (20h, 30h).
    DownloadSegment {
        /// As in the request.
        toggle: bool,
    },
    /// The value of an object of at most 4 bytes (4Xh).
    Upload {
        /// The object.
        object: ObjectAddress,
        /// Its value.
        data: Expedited,
    },
    /// The object's value comes in segments (40h, 41h).
    InitiateUpload {
        /// The object.
        object: ObjectAddress,
        /// Number of bytes that follow, if known.
        size: Option<u32>,
    },
    /// The next bytes (0Xh, 1Xh).
    UploadSegment {
        /// As in the request.
        toggle: bool,
        /// The bytes.
        data: Segment,
        /// Whether this segment is the last.
        is_last: bool,
    },
    /// The transfer failed (80h).
    Abort {
        /// The transfer's object.
        object: ObjectAddress,
        /// The reason.
        code: AbortCode,
    },
}

/// Coding of the messages of one direction. The direction with the data has three forms of message, the other direction
/// two. The forms are the same in both, with other command specifiers.
macro_rules! sdo_messages {
    ($message:ident, $name:literal: $value:ident or $sized:ident = $initiate:literal,
     $bytes:ident = $segment:literal, $bare:ident = $object:literal, $toggled:ident = $next:literal) => {
        impl $message {
            #[doc = concat!("The frame that carries the ", $name, " from or to that node's server.")]
            pub fn frame(self, node: NodeId) -> Frame {
                Frame::fixed(Cob::$message(node).into(), self.encode())
            }

            /// The data bytes.
            pub fn encode(self) -> [u8; LENGTH] {
                match self {
                    Self::$value { object, data } => initiate($initiate, object, data.field()),
                    Self::$sized { object, size } => initiate($initiate, object, size_field(size)),
                    Self::$bytes { toggle, data, is_last } => segment($segment, toggle, data.field(is_last)),
                    Self::$bare { object } => initiate($object, object, (0, [0; 4])),
                    Self::$toggled { toggle } => segment($next, toggle, (0, [0; 7])),
                    Self::Abort { object, code } => initiate(ABORT, object, (0, code.0.to_le_bytes())),
                }
            }

            /// Reads the data bytes. Bits and bytes that a message does not use are ignored.
            ///
            /// # Errors
            /// [`SdoError`] for another length than 8 or an unknown command specifier.
            pub fn decode(data: &[u8]) -> Result<Self, SdoError> {
                let message = Message(exactly($name, data)?);
                let (object, toggle) = (message.object(), message.has(TOGGLE));
                Ok(match message.specifier() {
                    $initiate if message.has(EXPEDITED) => Self::$value { object, data: message.expedited() },
                    $initiate => Self::$sized { object, size: message.size() },
                    $segment => Self::$bytes { toggle, data: message.segment(), is_last: message.has(LAST) },
                    $object => Self::$bare { object },
                    $next => Self::$toggled { toggle },
                    ABORT => Self::Abort { object, code: AbortCode(message.number()) },
                    _ => return Err(message.unknown()),
                })
            }
        }
    };
}

sdo_messages!(SdoRequest, "SDO request": Download or InitiateDownload = 1, DownloadSegment = 0,
    InitiateUpload = 2, UploadSegment = 3);
sdo_messages!(SdoResponse, "SDO response": Upload or InitiateUpload = 2, UploadSegment = 0,
    Download = 3, DownloadSegment = 1);

/// Data that is not an SDO message of this direction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// Wrong length.
    #[error(transparent)]
    Length(#[from] LengthError),
    /// An unsupported command specifier; a server aborts with
    /// [`AbortCode::UNKNOWN_COMMAND`].
    #[error("command {command:02X}h for {object} is no expedited or segmented SDO service")]
    UnknownCommand {
        /// The first byte.
        command: u8,
        /// The bytes of the object's address.
        object: ObjectAddress,
    },
}

/// A message with command specifier, object, flags and four bytes.
fn initiate(specifier: u8, object: ObjectAddress, (flags, data): (u8, [u8; 4])) -> [u8; LENGTH] {
    let [index_low, index_high] = object.index.to_le_bytes();
    let [d0, d1, d2, d3] = data;
    [specifier << 5 | flags, index_low, index_high, object.subindex, d0, d1, d2, d3]
}

/// A message with command specifier, toggle bit, and a segment's flags and data.
fn segment(specifier: u8, toggle: bool, (flags, data): (u8, [u8; Segment::MAX])) -> [u8; LENGTH] {
    let mut bytes = [0; LENGTH];
    bytes[0] = specifier << 5 | flags | if toggle { TOGGLE } else { 0 };
    bytes[1..].copy_from_slice(&data);
    bytes
}

/// The size of a transfer in an initiate message: flags and data.
fn size_field(size: Option<u32>) -> (u8, [u8; 4]) {
    size.map_or((0, [0; 4]), |size| (SIZED, size.to_le_bytes()))
}

/// A received message. The command specifier decides which parts are present.
struct Message([u8; LENGTH]);

impl Message {
    /// The top three bits of the first byte.
    fn specifier(&self) -> u8 {
        self.0[0] >> 5
    }

    fn has(&self, flag: u8) -> bool {
        self.0[0] & flag != 0
    }

    fn object(&self) -> ObjectAddress {
        let [_, low, high, subindex, ..] = self.0;
        ObjectAddress { index: u16::from_le_bytes([low, high]), subindex }
    }

    fn number(&self) -> u32 {
        let [.., d0, d1, d2, d3] = self.0;
        u32::from_le_bytes([d0, d1, d2, d3])
    }

    fn size(&self) -> Option<u32> {
        self.has(SIZED).then(|| self.number())
    }

    fn expedited(&self) -> Expedited {
        let bytes = self.number().to_le_bytes();
        if !self.has(SIZED) {
            return Expedited::of_unknown_size(bytes);
        }
        let unused = usize::from(self.0[0] >> 2 & 0b11);
        Expedited::new(&bytes[..Expedited::MAX - unused]).expect("two bits leave 1 to 4 bytes")
    }

    fn segment(&self) -> Segment {
        let unused = usize::from(self.0[0] >> 1 & 0b111);
        Segment::new(&self.0[1..LENGTH - unused]).expect("three bits leave 0 to 7 bytes")
    }

    fn unknown(&self) -> SdoError {
        SdoError::UnknownCommand { command: self.0[0], object: self.object() }
    }
}

/// The value in an expedited message: 1 to 4 bytes. A message without a size has 4 bytes, and the receiver must know
/// the length of the value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Expedited {
    /// Bytes beyond `length` are zero.
    bytes: [u8; Self::MAX],
    length: u8,
    is_sized: bool,
}

impl Expedited {
    /// The most bytes the message carries.
    pub const MAX: usize = 4;

    /// A value of that many bytes; `None` with none or more than 4.
    pub fn new(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len()).filter(|_| !data.is_empty())?.copy_from_slice(data);
        Some(Self { bytes, length: data.len() as u8, is_sized: true })
    }

    /// Four bytes without a size.
    pub const fn of_unknown_size(bytes: [u8; Self::MAX]) -> Self {
        Self { bytes, length: Self::MAX as u8, is_sized: false }
    }

    /// The bytes; all four when the message has no size.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// Whether the message has a size.
    pub const fn is_sized(&self) -> bool {
        self.is_sized
    }

    /// Flags and data of the message.
    fn field(self) -> (u8, [u8; Self::MAX]) {
        let unused = Self::MAX as u8 - self.length;
        (EXPEDITED | if self.is_sized { SIZED | unused << 2 } else { 0 }, self.bytes)
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
    /// The most bytes the message carries.
    pub const MAX: usize = 7;

    /// A segment of that data; `None` with more than 7 bytes.
    pub fn new(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MAX];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { bytes, length: data.len() as u8 })
    }

    /// The data.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }

    /// Flags and data of the message.
    fn field(self, is_last: bool) -> (u8, [u8; Self::MAX]) {
        let unused = Self::MAX as u8 - self.length;
        (unused << 1 | if is_last { LAST } else { 0 }, self.bytes)
    }
}

/// Abort code. Every number is a valid code; the codes of the standard have names and meanings.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub struct AbortCode(pub u32);

macro_rules! abort_codes {
    ($($name:ident = $code:literal, $meaning:literal;)*) => {
        impl AbortCode {
            $(#[doc = concat!("The ", $meaning, ".")] pub const $name: Self = Self($code);)*

            /// The meaning in the standard; `None` for a code of a manufacturer.
            pub const fn meaning(self) -> Option<&'static str> {
                match self.0 {
                    $($code => Some($meaning),)*
                    _ => None,
                }
            }
        }
    };
}

abort_codes! {
    TOGGLE = 0x0503_0000, "toggle bit did not alternate";
    TIMED_OUT = 0x0504_0000, "SDO protocol timed out";
    UNKNOWN_COMMAND = 0x0504_0001, "command specifier is not valid or unknown";
    BLOCK_SIZE = 0x0504_0002, "block size is not valid";
    SEQUENCE = 0x0504_0003, "sequence number is not valid";
    CRC = 0x0504_0004, "CRC does not match the data";
    OUT_OF_MEMORY = 0x0504_0005, "memory does not suffice";
    UNSUPPORTED_ACCESS = 0x0601_0000, "access to the object is not supported";
    WRITE_ONLY = 0x0601_0001, "object is write-only";
    READ_ONLY = 0x0601_0002, "object is read-only";
    NO_OBJECT = 0x0602_0000, "object does not exist";
    NOT_MAPPABLE = 0x0604_0041, "object cannot be mapped to the PDO";
    PDO_LENGTH = 0x0604_0042, "mapped objects would exceed the PDO's length";
    PARAMETER_INCOMPATIBLE = 0x0604_0043, "parameter is incompatible, or its object is in use";
    INTERNAL_INCOMPATIBILITY = 0x0604_0047, "device is internally incompatible";
    HARDWARE = 0x0606_0000, "hardware failed";
    LENGTH = 0x0607_0010, "length does not match the data type";
    TOO_LONG = 0x0607_0012, "data is longer than its type";
    TOO_SHORT = 0x0607_0013, "data is shorter than its type";
    NO_SUBINDEX = 0x0609_0011, "sub-index does not exist";
    INVALID_VALUE = 0x0609_0030, "value is invalid";
    TOO_HIGH = 0x0609_0031, "value is too high";
    TOO_LOW = 0x0609_0032, "value is too low";
    MAXIMUM_BELOW_MINIMUM = 0x0609_0036, "maximum is below the minimum";
    NOT_AVAILABLE = 0x060A_0023, "resource is not available: no SDO connection";
    GENERAL = 0x0800_0000, "transfer failed";
    NOT_STORED = 0x0800_0020, "data cannot be transferred or stored";
    LOCAL_CONTROL = 0x0800_0021, "data cannot be transferred or stored because of local control";
    DEVICE_STATE = 0x0800_0022, "device's present state does not allow it";
    NO_DICTIONARY = 0x0800_0023, "object dictionary is missing or could not be generated";
    NO_DATA = 0x0800_0024, "object has no data";
}

impl fmt::Display for AbortCode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:08X}h", self.0)?;
        self.meaning().map_or(Ok(()), |meaning| write!(f, " ({meaning})"))
    }
}
