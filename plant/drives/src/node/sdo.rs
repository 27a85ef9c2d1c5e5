//! The drive's SDO server: one transfer at a time, expedited, in segments or in blocks.
//!
//! The server keeps the order of a transfer. [`DictionaryAccess`] reads and writes the entries, [`block`](super::block)
//! has the state of a block transfer.

use masseter_can::canopen::{
    AbortCode, BlockMessage, BlockSegment, ObjectAddress, SdoError, SdoRequest, SdoResponse, Segment,
};

use super::access::{DictionaryAccess, Value};
use super::block::{BLOCK_SIZE, BlockDownload, BlockUpload};

/// Silence of a client that ends a transfer, ns.
const TIMEOUT_NS: u64 = 1_000_000_000;
/// Time from one segment of a block to the next, ns: about that of a frame at 125 kbit/s, so that no queue overflows.
const SEGMENT_EVERY_NS: u64 = 1_000_000;

/// The data bytes of an answer.
pub(super) type Response = [u8; 8];

/// The rest of a transfer.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum Progress {
    Upload { data: Vec<u8>, sent: usize },
    Download { received: Vec<u8>, room: usize, announced: Option<u32> },
    BlockUpload(BlockUpload),
    BlockDownload(BlockDownload),
}

/// A transfer that has begun.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
struct Transfer {
    object: ObjectAddress,
    /// The toggle bit that the next segment must have.
    toggle: bool,
    heard_ns: u64,
    progress: Progress,
}

impl Transfer {
    fn begin(now_ns: u64, object: ObjectAddress, progress: Progress) -> Self {
        Self { object, toggle: false, heard_ns: now_ns, progress }
    }

    /// The transfer after a segment with that toggle bit.
    fn continued(self, now_ns: u64, toggle: bool) -> Result<Self, AbortCode> {
        if self.toggle != toggle {
            return Err(AbortCode::TOGGLE);
        }
        Ok(Self { toggle: !toggle, heard_ns: now_ns, ..self })
    }

    /// Whether the next frame is a segment of a block.
    fn takes_segments(&self) -> bool {
        matches!(&self.progress, Progress::BlockDownload(download) if !download.is_whole())
    }
}

/// The answer to a request, if it has one, with the rest of the transfer.
type Answer = Result<(Option<Response>, Option<Transfer>), AbortCode>;

/// The server's memory.
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct SdoServer {
    transfer: Option<Transfer>,
}

impl SdoServer {
    /// Takes a request; returns the answer, if there is one.
    pub(super) fn answer(&mut self, data: &[u8], access: &mut DictionaryAccess<'_>) -> Option<Response> {
        let request = match SdoRequest::decode(data) {
            Err(SdoError::Length(_)) => return None,
            request => request,
        };
        let transfer = self.transfer.take();
        let running = transfer.as_ref().map_or(ObjectAddress::new(0, 0), |transfer| transfer.object);
        // In a block every frame but an abort is a segment.
        let segment = transfer.as_ref().filter(|transfer| transfer.takes_segments());
        let (object, answer) = match (segment.and_then(|_| BlockSegment::decode(data)), request) {
            (Some(segment), _) => (running, take_segment(transfer, segment, access.now_ns)),
            (None, Ok(SdoRequest::Abort { .. }) | Err(SdoError::Length(_))) => return None,
            (None, Ok(request)) => take_request(transfer, request, running, access),
            (None, Err(SdoError::UnknownCommand { object, .. })) => match BlockMessage::decode(data) {
                Some(message) => take_block_message(transfer, message, running, access),
                None => (object, Err(AbortCode::UNKNOWN_COMMAND)),
            },
        };
        let abort = |code| (Some(SdoResponse::Abort { object, code }.encode()), None);
        let (response, transfer) = answer.unwrap_or_else(abort);
        self.transfer = transfer;
        response
    }

    /// The server's next frame without a request: an abort after the silence of the client, or a segment of a block.
    pub(super) fn step(&mut self, now_ns: u64) -> Option<Response> {
        let transfer = self.transfer.as_mut()?;
        if now_ns.saturating_sub(transfer.heard_ns) > TIMEOUT_NS {
            let object = transfer.object;
            self.transfer = None;
            return Some(SdoResponse::Abort { object, code: AbortCode::TIMED_OUT }.encode());
        }
        let Progress::BlockUpload(upload) = &mut transfer.progress else { return None };
        if now_ns < transfer.heard_ns + SEGMENT_EVERY_NS {
            return None;
        }
        let segment = upload.next_segment()?;
        transfer.heard_ns = now_ns;
        Some(segment.encode())
    }
}

/// Takes a request of an expedited transfer or one in segments; returns its object and the answer.
fn take_request(
    transfer: Option<Transfer>,
    request: SdoRequest,
    running: ObjectAddress,
    access: &mut DictionaryAccess<'_>,
) -> (ObjectAddress, Answer) {
    let now_ns = access.now_ns;
    let continued = |toggle| transfer.ok_or(AbortCode::UNKNOWN_COMMAND)?.continued(now_ns, toggle);
    match request {
        SdoRequest::InitiateUpload { object } => (object, begin_upload(object, access)),
        SdoRequest::UploadSegment { toggle } => {
            (running, continued(toggle).and_then(|transfer| upload(transfer, toggle)))
        }
        SdoRequest::Download { object, data } => {
            let written = access.write(object, data.data(), data.is_sized());
            (object, written.map(|()| (Some(SdoResponse::Download { object }.encode()), None)))
        }
        SdoRequest::InitiateDownload { object, size } => (object, begin_download(object, size, access)),
        SdoRequest::DownloadSegment { toggle, data, is_last } => {
            let answer = continued(toggle).and_then(|transfer| download(transfer, data, is_last, access));
            let response = SdoResponse::DownloadSegment { toggle };
            (running, answer.map(|transfer| (Some(response.encode()), transfer)))
        }
        SdoRequest::Abort { .. } => (running, Ok((None, None))),
    }
}

fn begin_upload(object: ObjectAddress, access: &mut DictionaryAccess<'_>) -> Answer {
    let (response, transfer) = match access.read(object)? {
        Value::Number(data) => (SdoResponse::Upload { object, data }, None),
        Value::Bytes(data) => {
            let response = SdoResponse::InitiateUpload { object, size: Some(data.len() as u32) };
            (response, Some(Transfer::begin(access.now_ns, object, Progress::Upload { data, sent: 0 })))
        }
    };
    Ok((Some(response.encode()), transfer))
}

fn upload(mut transfer: Transfer, toggle: bool) -> Answer {
    let Progress::Upload { data, sent } = &mut transfer.progress else {
        return Err(AbortCode::UNKNOWN_COMMAND);
    };
    let rest = &data[*sent..];
    let now = &rest[..rest.len().min(Segment::MAX)];
    *sent += now.len();
    let is_last = now.len() == rest.len();
    let data = Segment::new(now).expect("no more than a segment holds");
    let response = SdoResponse::UploadSegment { toggle, data, is_last };
    Ok((Some(response.encode()), (!is_last).then_some(transfer)))
}

fn begin_download(object: ObjectAddress, size: Option<u32>, access: &DictionaryAccess<'_>) -> Answer {
    let room = access.room(object, size)?;
    let progress = Progress::Download { received: Vec::new(), room, announced: size };
    let transfer = Transfer::begin(access.now_ns, object, progress);
    Ok((Some(SdoResponse::Download { object }.encode()), Some(transfer)))
}

/// Takes a segment and writes the entry with the last one; returns the transfer that goes on.
fn download(
    mut transfer: Transfer,
    data: Segment,
    is_last: bool,
    access: &mut DictionaryAccess<'_>,
) -> Result<Option<Transfer>, AbortCode> {
    let Progress::Download { received, room, announced } = &mut transfer.progress else {
        return Err(AbortCode::UNKNOWN_COMMAND);
    };
    received.extend_from_slice(data.data());
    if received.len() > *room {
        return Err(AbortCode::TOO_LONG);
    }
    if !is_last {
        return Ok(Some(transfer));
    }
    if announced.is_some_and(|size| size as usize != received.len()) {
        return Err(AbortCode::LENGTH);
    }
    access.write(transfer.object, received, true)?;
    Ok(None)
}

/// Takes a message of a block transfer; returns its object and the answer.
fn take_block_message(
    transfer: Option<Transfer>,
    message: BlockMessage,
    running: ObjectAddress,
    access: &mut DictionaryAccess<'_>,
) -> (ObjectAddress, Answer) {
    match message {
        BlockMessage::Receive { object, has_crc, block_size, .. } => {
            (object, begin_block_upload(object, has_crc, block_size, access))
        }
        BlockMessage::Send { object, has_crc, size } => {
            (object, begin_block_download(object, has_crc, size, access))
        }
        message => (running, continue_block(transfer, message, access)),
    }
}

fn begin_block_upload(
    object: ObjectAddress,
    has_crc: bool,
    block_size: u8,
    access: &mut DictionaryAccess<'_>,
) -> Answer {
    let data = match access.read(object)? {
        Value::Number(data) => data.data().to_vec(),
        Value::Bytes(data) => data,
    };
    let response = BlockMessage::Send { object, has_crc: true, size: Some(data.len() as u32) };
    let progress = Progress::BlockUpload(BlockUpload::new(data, has_crc, block_size)?);
    Ok((Some(response.encode()), Some(Transfer::begin(access.now_ns, object, progress))))
}

fn begin_block_download(
    object: ObjectAddress,
    has_crc: bool,
    size: Option<u32>,
    access: &DictionaryAccess<'_>,
) -> Answer {
    let room = access.room(object, size)?;
    let response = BlockMessage::Receive { object, has_crc: true, block_size: BLOCK_SIZE, threshold: 0 };
    let progress = Progress::BlockDownload(BlockDownload::new(has_crc, size, room));
    Ok((Some(response.encode()), Some(Transfer::begin(access.now_ns, object, progress))))
}

fn take_segment(transfer: Option<Transfer>, segment: BlockSegment, now_ns: u64) -> Answer {
    let mut transfer = transfer.ok_or(AbortCode::UNKNOWN_COMMAND)?;
    let Progress::BlockDownload(download) = &mut transfer.progress else {
        return Err(AbortCode::UNKNOWN_COMMAND);
    };
    let response = download.take(segment)?;
    transfer.heard_ns = now_ns;
    Ok((response.map(BlockMessage::encode), Some(transfer)))
}

fn continue_block(
    transfer: Option<Transfer>,
    message: BlockMessage,
    access: &mut DictionaryAccess<'_>,
) -> Answer {
    let mut transfer = transfer.ok_or(AbortCode::UNKNOWN_COMMAND)?;
    transfer.heard_ns = access.now_ns;
    match (&mut transfer.progress, message) {
        (Progress::BlockUpload(upload), BlockMessage::EndReceiving) if upload.is_ending() => Ok((None, None)),
        (Progress::BlockUpload(upload), message) => {
            let response = upload.take(message)?;
            Ok((response.map(BlockMessage::encode), Some(transfer)))
        }
        (Progress::BlockDownload(download), BlockMessage::EndSending { unused, crc }) => {
            access.write(transfer.object, download.end(unused, crc)?, true)?;
            Ok((Some(BlockMessage::EndReceiving.encode()), None))
        }
        _ => Err(AbortCode::UNKNOWN_COMMAND),
    }
}
