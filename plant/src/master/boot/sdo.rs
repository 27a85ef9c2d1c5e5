//! The SDO client (CiA 301, 7.2.4): one entry of one drive's object dictionary read or written at a
//! time. Values are read expedited or in segments and written expedited.
//!
//! A pure state machine: [`SdoClient::poll`] returns the request to send, [`SdoClient::take`] takes the answer.
//! It knows neither frames nor buses, and keeps values of at most [`Data::MAX`] bytes. Block transfer is not
//! used.

use masseter_can::canopen::{AbortCode, Expedited, ObjectAddress, SdoRequest, SdoResponse, Segment};

/// Silence of a server after which a transfer begins anew, ns. Drives that store parameters or boot take seconds, and
/// nothing that moves waits for them.
pub(super) const TIMEOUT_NS: u64 = 1_000_000_000;
/// Attempts of a transfer before the server counts as silent.
pub(super) const ATTEMPTS: u32 = 3;

/// An object's value as bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Data {
    /// Bytes beyond `length` are zero.
    bytes: [u8; Self::MAX],
    length: usize,
}

impl Data {
    /// Bytes it holds at most.
    pub(super) const MAX: usize = 64;

    pub(super) const EMPTY: Self = Self { bytes: [0; Self::MAX], length: 0 };

    /// The bytes.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// As an unsigned little-endian number; `None` unless there are 1 to 4 bytes.
    pub(super) fn number(&self) -> Option<u32> {
        let mut word = [0; 4];
        word.get_mut(..self.length).filter(|word| !word.is_empty())?.copy_from_slice(self.bytes());
        Some(u32::from_le_bytes(word))
    }

    /// Adds bytes at the end; whether they fit.
    fn append(&mut self, bytes: &[u8]) -> bool {
        let end = self.length + bytes.len();
        let Some(place) = self.bytes.get_mut(self.length..end) else { return false };
        place.copy_from_slice(bytes);
        self.length = end;
        true
    }
}

/// Why a transfer failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SdoFailure {
    /// One side gave it up.
    Aborted { object: ObjectAddress, code: AbortCode },
    /// Nothing came.
    Silent { object: ObjectAddress },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Transfer {
    object: ObjectAddress,
    /// The value to be written; none in a read.
    written: Option<Expedited>,
    /// Toggle bit of the next segment of a read; none while the first answer decides whether there are segments.
    segment: Option<bool>,
    received: Data,
    /// Time of the last request; none while one is due.
    sent_ns: Option<u64>,
    attempt: u32,
}

/// The client's memory: at most one transfer, its result, and an abort that is still to be sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct SdoClient {
    transfer: Option<Transfer>,
    outcome: Option<Result<Data, SdoFailure>>,
    abort: Option<(ObjectAddress, AbortCode)>,
}

impl SdoClient {
    /// Begins to read an object; a transfer under way is forgotten.
    pub(super) fn read(&mut self, object: ObjectAddress) {
        self.begin(object, None);
    }

    /// Begins to write an object; a transfer under way is forgotten.
    pub(super) fn write(&mut self, object: ObjectAddress, data: Expedited) {
        self.begin(object, Some(data));
    }

    fn begin(&mut self, object: ObjectAddress, written: Option<Expedited>) {
        self.outcome = None;
        self.transfer = Some(Transfer {
            object,
            written,
            segment: None,
            received: Data::EMPTY,
            sent_ns: None,
            attempt: 1,
        });
    }

    /// Whether nothing is under way and no result is waiting.
    pub(super) fn is_idle(&self) -> bool {
        self.transfer.is_none() && self.outcome.is_none()
    }

    /// Whether the transfer under way has begun more than once, so that an answer may come twice.
    pub(super) fn is_repeating(&self) -> bool {
        self.transfer.is_some_and(|transfer| transfer.attempt > 1)
    }

    /// The result of the transfer, once: what was read (nothing for a write), or why it failed.
    pub(super) fn outcome(&mut self) -> Option<Result<Data, SdoFailure>> {
        self.outcome.take()
    }

    /// Begins a transfer anew after the time-out, and gives it up after [`ATTEMPTS`].
    pub(super) fn expire(&mut self, now_ns: u64) {
        let Some(transfer) = &mut self.transfer else { return };
        if transfer.sent_ns.is_none_or(|sent_ns| now_ns.saturating_sub(sent_ns) <= TIMEOUT_NS) {
            return;
        }
        if transfer.attempt < ATTEMPTS {
            transfer.attempt += 1;
            (transfer.segment, transfer.received, transfer.sent_ns) = (None, Data::EMPTY, None);
        } else {
            let object = transfer.object;
            self.abort = Some((object, AbortCode::TIMED_OUT));
            self.finish(Err(SdoFailure::Silent { object }));
        }
    }

    /// The request that is due, if any.
    pub(super) fn poll(&mut self, now_ns: u64) -> Option<SdoRequest> {
        if let Some((object, code)) = self.abort.take() {
            return Some(SdoRequest::Abort { object, code });
        }
        let transfer = self.transfer.as_mut().filter(|transfer| transfer.sent_ns.is_none())?;
        transfer.sent_ns = Some(now_ns);
        Some(transfer.request())
    }

    /// Takes an answer of the server; returns whether it was expected. An answer is unasked after a transfer begun twice,
    /// in a frame that came twice, and from a second server with the same node id.
    pub(super) fn take(&mut self, response: SdoResponse) -> bool {
        let Some(mut transfer) = self.transfer.filter(|transfer| transfer.sent_ns.is_some()) else {
            return false;
        };
        let object = transfer.object;
        match transfer.advance(response) {
            Progress::Foreign => return false,
            Progress::Continue => {
                transfer.sent_ns = None;
                self.transfer = Some(transfer);
            }
            Progress::Done => self.finish(Ok(transfer.received)),
            Progress::Refused(code) => self.finish(Err(SdoFailure::Aborted { object, code })),
            Progress::Broken(code) => {
                self.abort = Some((object, code));
                self.finish(Err(SdoFailure::Aborted { object, code }));
            }
        }
        true
    }

    fn finish(&mut self, outcome: Result<Data, SdoFailure>) {
        (self.transfer, self.outcome) = (None, Some(outcome));
    }
}

/// Effect of an answer on a transfer.
enum Progress {
    /// None: the answer belongs to another transfer.
    Foreign,
    /// The next request is due.
    Continue,
    Done,
    /// The server aborted.
    Refused(AbortCode),
    /// The client aborts, with a message to the server.
    Broken(AbortCode),
}

impl Transfer {
    fn request(&self) -> SdoRequest {
        let object = self.object;
        match (self.segment, self.written) {
            (None, None) => SdoRequest::InitiateUpload { object },
            (None, Some(data)) => SdoRequest::Download { object, data },
            (Some(toggle), _) => SdoRequest::UploadSegment { toggle },
        }
    }

    fn advance(&mut self, response: SdoResponse) -> Progress {
        let reads = self.written.is_none();
        match (response, self.segment) {
            (SdoResponse::Abort { object, code }, _) if object == self.object => Progress::Refused(code),
            (SdoResponse::Download { object }, None) if object == self.object && !reads => Progress::Done,
            (SdoResponse::Upload { object, data }, None) if object == self.object && reads => {
                self.received.append(data.data());
                Progress::Done
            }
            (SdoResponse::InitiateUpload { object, size }, None) if object == self.object && reads => {
                if size.is_some_and(|size| size as usize > Data::MAX) {
                    return Progress::Broken(AbortCode::OUT_OF_MEMORY);
                }
                self.segment = Some(false);
                Progress::Continue
            }
            (SdoResponse::UploadSegment { toggle, data, is_last }, Some(expected)) => {
                self.read_segment(toggle == expected, data, is_last, expected)
            }
            _ => Progress::Foreign,
        }
    }

    fn read_segment(&mut self, alternates: bool, data: Segment, is_last: bool, toggle: bool) -> Progress {
        if !alternates {
            return Progress::Broken(AbortCode::TOGGLE);
        }
        if !self.received.append(data.data()) {
            return Progress::Broken(AbortCode::OUT_OF_MEMORY);
        }
        self.segment = Some(!toggle);
        if is_last { Progress::Done } else { Progress::Continue }
    }
}

#[cfg(test)]
mod tests;
