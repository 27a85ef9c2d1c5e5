//! Requests of an SDO client.

use super::abort::AbortCode;
use super::message::{ABORT, Initiate, LAST, SdoError, TOGGLE, initiate, segment, size_field, specifier};
use super::object::ObjectAddress;
use super::payload::{Expedited, LENGTH, Segment};
use crate::canopen::{Cob, NodeId, exactly};
use crate::frame::Frame;

const DOWNLOAD_SEGMENT: u8 = 0;
const INITIATE_DOWNLOAD: u8 = 1;
const INITIATE_UPLOAD: u8 = 2;
const UPLOAD_SEGMENT: u8 = 3;

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

impl SdoRequest {
    /// The frame that carries the request to that node's server.
    pub fn frame(self, node: NodeId) -> Frame {
        Frame::fixed(Cob::SdoRequest(node).into(), self.encode())
    }

    /// The data bytes.
    pub fn encode(self) -> [u8; LENGTH] {
        match self {
            Self::Download { object, data } => initiate(INITIATE_DOWNLOAD, data.flags(), object, data.bytes),
            Self::InitiateDownload { object, size } => {
                let (flags, size) = size_field(size);
                initiate(INITIATE_DOWNLOAD, flags, object, size)
            }
            Self::DownloadSegment { toggle, data, is_last } => {
                segment(DOWNLOAD_SEGMENT, toggle, Some((&data, is_last)))
            }
            Self::InitiateUpload { object } => initiate(INITIATE_UPLOAD, 0, object, [0; 4]),
            Self::UploadSegment { toggle } => segment(UPLOAD_SEGMENT, toggle, None),
            Self::Abort { object, code } => initiate(ABORT, 0, object, code.0.to_le_bytes()),
        }
    }

    /// Reads the data bytes. Bits and bytes that a message does not use are ignored.
    ///
    /// # Errors
    /// [`SdoError`] for another length than 8 or an unknown command specifier.
    pub fn decode(data: &[u8]) -> Result<Self, SdoError> {
        let bytes = exactly("SDO request", data)?;
        let message = Initiate::parse(bytes);
        let (object, toggle) = (message.object, message.command & TOGGLE != 0);
        match specifier(message.command) {
            DOWNLOAD_SEGMENT => {
                let is_last = message.command & LAST != 0;
                Ok(Self::DownloadSegment { toggle, data: Segment::from_message(bytes), is_last })
            }
            INITIATE_DOWNLOAD if message.is_expedited() => {
                Ok(Self::Download { object, data: message.expedited() })
            }
            INITIATE_DOWNLOAD => Ok(Self::InitiateDownload { object, size: message.size() }),
            INITIATE_UPLOAD => Ok(Self::InitiateUpload { object }),
            UPLOAD_SEGMENT => Ok(Self::UploadSegment { toggle }),
            ABORT => Ok(Self::Abort { object, code: message.abort_code() }),
            _ => Err(message.unknown()),
        }
    }
}
