//! Responses of an SDO server.

use super::abort::AbortCode;
use super::message::{ABORT, Initiate, LAST, SdoError, TOGGLE, initiate, segment, size_field, specifier};
use super::object::ObjectAddress;
use super::payload::{Expedited, LENGTH, Segment};
use crate::canopen::{Cob, NodeId, exactly};
use crate::frame::Frame;

const UPLOAD_SEGMENT: u8 = 0;
const DOWNLOAD_SEGMENT: u8 = 1;
const INITIATE_UPLOAD: u8 = 2;
const INITIATE_DOWNLOAD: u8 = 3;

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

impl SdoResponse {
    /// The frame in which that node's server sends the response.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::SdoResponse(node).into(), self.encode())
    }

    /// The data bytes.
    pub fn encode(self) -> [u8; LENGTH] {
        match self {
            Self::Download { object } => initiate(INITIATE_DOWNLOAD, 0, object, [0; 4]),
            Self::DownloadSegment { toggle } => segment(DOWNLOAD_SEGMENT, toggle, None),
            Self::Upload { object, data } => initiate(INITIATE_UPLOAD, data.flags(), object, data.bytes),
            Self::InitiateUpload { object, size } => {
                let (flags, size) = size_field(size);
                initiate(INITIATE_UPLOAD, flags, object, size)
            }
            Self::UploadSegment { toggle, data, is_last } => {
                segment(UPLOAD_SEGMENT, toggle, Some((&data, is_last)))
            }
            Self::Abort { object, code } => initiate(ABORT, 0, object, code.0.to_le_bytes()),
        }
    }

    /// Reads the data bytes. Bits and bytes that a message does not use are ignored.
    ///
    /// # Errors
    /// [`SdoError`] for another length than 8 or an unknown command specifier.
    pub fn decode(data: &[u8]) -> Result<Self, SdoError> {
        let bytes = exactly("SDO response", data)?;
        let message = Initiate::parse(bytes);
        let (object, toggle) = (message.object, message.command & TOGGLE != 0);
        match specifier(message.command) {
            UPLOAD_SEGMENT => {
                let is_last = message.command & LAST != 0;
                Ok(Self::UploadSegment { toggle, data: Segment::from_message(bytes), is_last })
            }
            DOWNLOAD_SEGMENT => Ok(Self::DownloadSegment { toggle }),
            INITIATE_UPLOAD if message.is_expedited() => {
                Ok(Self::Upload { object, data: message.expedited() })
            }
            INITIATE_UPLOAD => Ok(Self::InitiateUpload { object, size: message.size() }),
            INITIATE_DOWNLOAD => Ok(Self::Download { object }),
            ABORT => Ok(Self::Abort { object, code: message.abort_code() }),
            _ => Err(message.unknown()),
        }
    }
}
