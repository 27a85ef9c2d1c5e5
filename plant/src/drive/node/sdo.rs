//! The drive's SDO server: one transfer at a time, expedited or in segments.
//!
//! The server only keeps the order of a transfer; [`DictionaryAccess`] reads and writes the entries.

use arrayvec::ArrayVec;
use masseter_can::canopen::{AbortCode, ObjectAddress, SdoError, SdoRequest, SdoResponse, Segment};

use super::access::{DictionaryAccess, Value};

/// Silence of a client in the middle of a transfer that ends it, ns.
const TIMEOUT_NS: u64 = 1_000_000_000;
/// The longest value that can be written.
const WRITABLE_BYTES: usize = 4;

/// What is left of a transfer.
#[derive(Debug, Clone)]
enum Progress {
    Upload { rest: &'static [u8] },
    Download { received: ArrayVec<u8, WRITABLE_BYTES>, announced: Option<u32> },
}

/// A transfer in segments that has begun.
#[derive(Debug, Clone)]
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
}

/// The answer to a request, with the transfer that goes on after it.
type Answer = Result<(SdoResponse, Option<Transfer>), AbortCode>;

/// The server's memory.
#[derive(Debug, Clone, Default)]
pub(super) struct SdoServer {
    transfer: Option<Transfer>,
}

impl SdoServer {
    /// Takes a request; returns the answer, if there is one.
    pub(super) fn answer(&mut self, data: &[u8], access: &mut DictionaryAccess<'_>) -> Option<SdoResponse> {
        let request = match SdoRequest::decode(data) {
            Ok(request) => request,
            Err(SdoError::UnknownCommand { object, .. }) => {
                self.transfer = None;
                return Some(SdoResponse::Abort { object, code: AbortCode::UNKNOWN_COMMAND });
            }
            Err(SdoError::Length(_)) => return None,
        };
        let now_ns = access.now_ns;
        let transfer = self.transfer.take();
        let running = transfer.as_ref().map_or(ObjectAddress::new(0, 0), |transfer| transfer.object);
        let continued = |toggle| transfer.ok_or(AbortCode::UNKNOWN_COMMAND)?.continued(now_ns, toggle);
        let (object, answer) = match request {
            SdoRequest::Abort { .. } => return None,
            SdoRequest::InitiateUpload { object } => (object, begin_upload(object, access)),
            SdoRequest::UploadSegment { toggle } => {
                (running, continued(toggle).and_then(|transfer| upload(transfer, toggle)))
            }
            SdoRequest::Download { object, data } => {
                let written = access.write(object, data.data(), data.is_sized());
                (object, written.map(|()| (SdoResponse::Download { object }, None)))
            }
            SdoRequest::InitiateDownload { object, size } => (object, begin_download(object, size, access)),
            SdoRequest::DownloadSegment { toggle, data, is_last } => {
                let answer = continued(toggle).and_then(|transfer| download(transfer, data, is_last, access));
                (running, answer.map(|transfer| (SdoResponse::DownloadSegment { toggle }, transfer)))
            }
        };
        let (response, transfer) = answer.unwrap_or_else(|code| (SdoResponse::Abort { object, code }, None));
        self.transfer = transfer;
        Some(response)
    }

    /// Aborts a transfer whose client has fallen silent; returns the abort message.
    pub(super) fn expire(&mut self, now_ns: u64) -> Option<SdoResponse> {
        let is_late = |transfer: &mut Transfer| now_ns.saturating_sub(transfer.heard_ns) > TIMEOUT_NS;
        let transfer = self.transfer.take_if(is_late)?;
        Some(SdoResponse::Abort { object: transfer.object, code: AbortCode::TIMED_OUT })
    }
}

fn begin_upload(object: ObjectAddress, access: &mut DictionaryAccess<'_>) -> Answer {
    Ok(match access.read(object)? {
        Value::Number(data) => (SdoResponse::Upload { object, data }, None),
        Value::Text(text) => {
            let response = SdoResponse::InitiateUpload { object, size: Some(text.len() as u32) };
            let progress = Progress::Upload { rest: text.as_bytes() };
            (response, Some(Transfer::begin(access.now_ns, object, progress)))
        }
    })
}

fn upload(mut transfer: Transfer, toggle: bool) -> Answer {
    let Progress::Upload { rest } = &mut transfer.progress else { return Err(AbortCode::UNKNOWN_COMMAND) };
    let (now, later) = rest.split_at(rest.len().min(Segment::MAX));
    *rest = later;
    let is_last = later.is_empty();
    let data = Segment::new(now).expect("no more than a segment holds");
    Ok((SdoResponse::UploadSegment { toggle, data, is_last }, (!is_last).then_some(transfer)))
}

fn begin_download(object: ObjectAddress, size: Option<u32>, access: &DictionaryAccess<'_>) -> Answer {
    access.overlay.find(object)?.1.check_access()?;
    if size.is_some_and(|size| size > WRITABLE_BYTES as u32) {
        return Err(AbortCode::TOO_LONG);
    }
    let progress = Progress::Download { received: ArrayVec::new(), announced: size };
    let transfer = Transfer::begin(access.now_ns, object, progress);
    Ok((SdoResponse::Download { object }, Some(transfer)))
}

/// Takes a segment and writes the entry with the last one; returns the transfer that goes on.
fn download(
    mut transfer: Transfer,
    data: Segment,
    is_last: bool,
    access: &mut DictionaryAccess<'_>,
) -> Result<Option<Transfer>, AbortCode> {
    let Progress::Download { received, announced } = &mut transfer.progress else {
        return Err(AbortCode::UNKNOWN_COMMAND);
    };
    received.try_extend_from_slice(data.data()).map_err(|_| AbortCode::TOO_LONG)?;
    if !is_last {
        return Ok(Some(transfer));
    }
    if announced.is_some_and(|size| size as usize != received.len()) {
        return Err(AbortCode::LENGTH);
    }
    access.write(transfer.object, received, true)?;
    Ok(None)
}
