//! The drive's SDO server: one transfer at a time, expedited or in segments.
//!
//! The server only keeps the order of a transfer; [`Dictionary`] reads and writes the entries.

use masseter_can::canopen::{
    AbortCode, Expedited, ObjectAddress, SdoError, SdoRequest, SdoResponse, Segment,
};

/// Silence of a client in the middle of a transfer that ends it, ns.
const TIMEOUT_NS: u64 = 1_000_000_000;
/// The longest value that can be written.
const WRITABLE_BYTES: usize = 4;

/// A value that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Value {
    Number(Expedited),
    Text(&'static str),
}

/// The entries that the server gives access to.
pub(super) trait Dictionary {
    /// The value of an entry.
    fn read(&mut self, object: ObjectAddress) -> Result<Value, AbortCode>;
    /// Whether an entry may be written at all.
    fn accepts(&self, object: ObjectAddress) -> Result<(), AbortCode>;
    /// Writes an entry; where `is_sized` is false, `data` may be longer than the value.
    fn write(&mut self, object: ObjectAddress, data: &[u8], is_sized: bool) -> Result<(), AbortCode>;
}

/// A transfer that has begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Progress {
    Upload { rest: &'static [u8] },
    Download { bytes: [u8; WRITABLE_BYTES], length: usize, announced: Option<u32> },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Transfer {
    object: ObjectAddress,
    /// The toggle bit that the next segment must have.
    toggle: bool,
    heard_ns: u64,
    progress: Progress,
}

/// The server's memory.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SdoServer {
    transfer: Option<Transfer>,
}

impl SdoServer {
    /// Takes a request that arrived at `now_ns`; returns the answer, if there is one.
    pub(super) fn answer(
        &mut self,
        now_ns: u64,
        data: &[u8],
        dictionary: &mut impl Dictionary,
    ) -> Option<SdoResponse> {
        let request = match SdoRequest::decode(data) {
            Ok(request) => request,
            Err(SdoError::UnknownCommand { object, .. }) => {
                self.transfer = None;
                return Some(SdoResponse::Abort { object, code: AbortCode::UNKNOWN_COMMAND });
            }
            Err(SdoError::Length(_)) => return None,
        };
        let object = self.object_of(request);
        let answer = match request {
            SdoRequest::Abort { .. } => {
                self.transfer = None;
                return None;
            }
            SdoRequest::InitiateUpload { object } => self.begin_upload(now_ns, object, dictionary),
            SdoRequest::UploadSegment { toggle } => self.upload(now_ns, toggle),
            SdoRequest::Download { object, data } => {
                self.transfer = None;
                let written = dictionary.write(object, data.data(), data.is_sized());
                written.map(|()| SdoResponse::Download { object })
            }
            SdoRequest::InitiateDownload { object, size } => {
                self.begin_download(now_ns, object, size, dictionary)
            }
            SdoRequest::DownloadSegment { toggle, data, is_last } => {
                self.download(now_ns, toggle, data, is_last, dictionary)
            }
        };
        Some(answer.unwrap_or_else(|code| {
            self.transfer = None;
            SdoResponse::Abort { object, code }
        }))
    }

    /// Aborts a transfer whose client has fallen silent; returns the abort message.
    pub(super) fn expire(&mut self, now_ns: u64) -> Option<SdoResponse> {
        let is_late = |transfer: &mut Transfer| now_ns.saturating_sub(transfer.heard_ns) > TIMEOUT_NS;
        let transfer = self.transfer.take_if(is_late)?;
        Some(SdoResponse::Abort { object: transfer.object, code: AbortCode::TIMED_OUT })
    }

    /// The object of a request: its own, or that of the transfer.
    fn object_of(&self, request: SdoRequest) -> ObjectAddress {
        match request {
            SdoRequest::Download { object, .. }
            | SdoRequest::InitiateDownload { object, .. }
            | SdoRequest::InitiateUpload { object }
            | SdoRequest::Abort { object, .. } => object,
            SdoRequest::DownloadSegment { .. } | SdoRequest::UploadSegment { .. } => {
                self.transfer.map_or(ObjectAddress::new(0, 0), |transfer| transfer.object)
            }
        }
    }

    fn begin(&mut self, now_ns: u64, object: ObjectAddress, progress: Progress) {
        self.transfer = Some(Transfer { object, toggle: false, heard_ns: now_ns, progress });
    }

    /// The transfer that a segment continues, its toggle bit turned.
    fn continued(&mut self, now_ns: u64, toggle: bool) -> Result<&mut Transfer, AbortCode> {
        let transfer = self.transfer.as_mut().ok_or(AbortCode::UNKNOWN_COMMAND)?;
        if transfer.toggle != toggle {
            return Err(AbortCode::TOGGLE);
        }
        (transfer.toggle, transfer.heard_ns) = (!toggle, now_ns);
        Ok(transfer)
    }

    fn begin_upload(
        &mut self,
        now_ns: u64,
        object: ObjectAddress,
        dictionary: &mut impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        self.transfer = None;
        match dictionary.read(object)? {
            Value::Number(data) => Ok(SdoResponse::Upload { object, data }),
            Value::Text(text) => {
                self.begin(now_ns, object, Progress::Upload { rest: text.as_bytes() });
                Ok(SdoResponse::InitiateUpload { object, size: Some(text.len() as u32) })
            }
        }
    }

    fn upload(&mut self, now_ns: u64, toggle: bool) -> Result<SdoResponse, AbortCode> {
        let transfer = self.continued(now_ns, toggle)?;
        let Progress::Upload { rest } = &mut transfer.progress else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        let (now, later) = rest.split_at(rest.len().min(Segment::MAX));
        *rest = later;
        let is_last = later.is_empty();
        if is_last {
            self.transfer = None;
        }
        let data = Segment::new(now).expect("no more than a segment holds");
        Ok(SdoResponse::UploadSegment { toggle, data, is_last })
    }

    fn begin_download(
        &mut self,
        now_ns: u64,
        object: ObjectAddress,
        size: Option<u32>,
        dictionary: &impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        dictionary.accepts(object)?;
        if size.is_some_and(|size| size > WRITABLE_BYTES as u32) {
            return Err(AbortCode::TOO_LONG);
        }
        let progress = Progress::Download { bytes: [0; WRITABLE_BYTES], length: 0, announced: size };
        self.begin(now_ns, object, progress);
        Ok(SdoResponse::Download { object })
    }

    fn download(
        &mut self,
        now_ns: u64,
        toggle: bool,
        data: Segment,
        is_last: bool,
        dictionary: &mut impl Dictionary,
    ) -> Result<SdoResponse, AbortCode> {
        let transfer = self.continued(now_ns, toggle)?;
        let Progress::Download { bytes, length, announced } = &mut transfer.progress else {
            return Err(AbortCode::UNKNOWN_COMMAND);
        };
        let end = *length + data.data().len();
        bytes.get_mut(*length..end).ok_or(AbortCode::TOO_LONG)?.copy_from_slice(data.data());
        *length = end;
        if is_last {
            if announced.is_some_and(|size| size as usize != end) {
                return Err(AbortCode::LENGTH);
            }
            let (object, bytes) = (transfer.object, *bytes);
            self.transfer = None;
            dictionary.write(object, &bytes[..end], true)?;
        }
        Ok(SdoResponse::DownloadSegment { toggle })
    }
}

#[cfg(test)]
mod tests;
