//! The SDO client (CiA 301, 7.2.4): one entry of one drive's object dictionary read or written at a
//! time. Only expedited transfers are used, because no object of a boot has more than four bytes.
//!
//! A pure state machine: [`SdoClient::poll`] returns the request to send, [`SdoClient::take_answer`] takes the answer.
//! Frames and buses are not part of it.

#[cfg(test)]
mod tests;

use masseter_can::canopen::{AbortCode, Expedited, ObjectAddress, SdoRequest, SdoResponse};

/// Silence of a server after which a transfer begins anew, ns. Drives that store parameters or boot take seconds, and
/// nothing that moves waits for them.
pub(super) const TIMEOUT_NS: u64 = 1_000_000_000;
/// Attempts of a transfer before the server counts as silent.
pub(super) const ATTEMPTS: u32 = 3;

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
    /// Time of the last request; none while one is due.
    sent_ns: Option<u64>,
    attempt: u32,
}

/// The client's memory: at most one transfer, and an abort that is still to be sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct SdoClient {
    transfer: Option<Transfer>,
    abort: Option<(ObjectAddress, AbortCode)>,
}

impl SdoClient {
    /// Begins to read an object, or to write a value to it; a transfer under way is forgotten.
    pub(super) fn begin(&mut self, object: ObjectAddress, written: Option<Expedited>) {
        self.transfer = Some(Transfer { object, written, sent_ns: None, attempt: 1 });
    }

    /// Whether nothing is under way.
    pub(super) fn is_idle(&self) -> bool {
        self.transfer.is_none()
    }

    /// Whether the transfer under way has begun more than once, so that an answer may come twice.
    pub(super) fn is_repeating(&self) -> bool {
        self.transfer.is_some_and(|transfer| transfer.attempt > 1)
    }

    /// Begins a transfer anew after the time-out, and gives it up after [`ATTEMPTS`].
    pub(super) fn expire(&mut self, now_ns: u64) -> Result<(), SdoFailure> {
        let Some(transfer) = &mut self.transfer else { return Ok(()) };
        if transfer.sent_ns.is_none_or(|sent_ns| now_ns.saturating_sub(sent_ns) <= TIMEOUT_NS) {
            return Ok(());
        }
        if transfer.attempt < ATTEMPTS {
            transfer.attempt += 1;
            transfer.sent_ns = None;
            return Ok(());
        }
        let object = transfer.object;
        (self.transfer, self.abort) = (None, Some((object, AbortCode::TIMED_OUT)));
        Err(SdoFailure::Silent { object })
    }

    /// The request that is due, if any.
    pub(super) fn poll(&mut self, now_ns: u64) -> Option<SdoRequest> {
        if let Some((object, code)) = self.abort.take() {
            return Some(SdoRequest::Abort { object, code });
        }
        let transfer = self.transfer.as_mut().filter(|transfer| transfer.sent_ns.is_none())?;
        transfer.sent_ns = Some(now_ns);
        let object = transfer.object;
        Some(match transfer.written {
            None => SdoRequest::InitiateUpload { object },
            Some(data) => SdoRequest::Download { object, data },
        })
    }

    /// Takes an answer of the server; returns the value read or written, or why the transfer failed. None for an unasked
    /// answer: there are some after a transfer begun twice, in a frame that came twice, and from a second server with the
    /// same node id.
    pub(super) fn take_answer(&mut self, response: SdoResponse) -> Option<Result<Expedited, SdoFailure>> {
        let Transfer { object, written, .. } = self.transfer.filter(|transfer| transfer.sent_ns.is_some())?;
        let outcome = match (response, written) {
            (SdoResponse::Abort { object: answered, code }, _) if answered == object => {
                Err(SdoFailure::Aborted { object, code })
            }
            (SdoResponse::Download { object: answered }, Some(data)) if answered == object => Ok(data),
            (SdoResponse::Upload { object: answered, data }, None) if answered == object => Ok(data),
            (SdoResponse::InitiateUpload { object: answered, .. }, None) if answered == object => {
                self.abort = Some((object, AbortCode::LENGTH));
                Err(SdoFailure::Aborted { object, code: AbortCode::LENGTH })
            }
            _ => return None,
        };
        self.transfer = None;
        Some(outcome)
    }
}

/// A value of at most four bytes as an unsigned little-endian number.
pub(crate) fn number(bytes: &[u8]) -> u32 {
    bytes.iter().rfold(0, |number, &byte| number << 8 | u32::from(byte))
}
