//! The SDO client (CiA 301, 7.2.4) of master and commissioning reads or writes one entry of one drive's object
//! dictionary at a time. It reads values of more than four bytes in segments for callers with room.
//!
//! A pure state machine: [`SdoClient::poll`] returns the request to send, [`SdoClient::take_answer`] takes the answer.
//! Frames and buses are not part of it.

#[cfg(test)]
mod tests;

use masseter_can::canopen::{AbortCode, Expedited, ObjectAddress, SdoRequest, SdoResponse};

/// Attempts of a transfer before the server counts as silent.
pub(crate) const ATTEMPTS: u32 = 3;
/// Bytes of the longest value that is read.
const LONGEST_VALUE: usize = 1792;

/// The reason for a missing answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error, serde::Serialize, serde::Deserialize)]
pub enum SdoReason {
    /// One side aborts the transfer, mostly the drive.
    #[error("{0}")]
    Aborted(AbortCode),
    /// No answer comes.
    #[error("no answer; check its power, wiring, bit rate and node id")]
    Silent,
}

/// A transfer that fails.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SdoFailure {
    /// The object.
    pub object: ObjectAddress,
    /// The reason.
    pub reason: SdoReason,
}

/// The next action of a transfer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Action {
    Read,
    ReadSegment { toggle: bool },
    Write(Expedited),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
struct Transfer {
    object: ObjectAddress,
    action: Action,
    /// Time of the last request; none while one is due.
    sent_ns: Option<u64>,
    attempt: u32,
}

/// The client's memory: at most one transfer, and an abort to be sent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct SdoClient {
    transfer: Option<Transfer>,
    abort: Option<(ObjectAddress, AbortCode)>,
}

impl SdoClient {
    /// Begins a read or a write of an object; forgets the present transfer.
    pub fn begin(&mut self, object: ObjectAddress, written: Option<Expedited>) {
        let action = written.map_or(Action::Read, Action::Write);
        self.transfer = Some(Transfer { object, action, sent_ns: None, attempt: 1 });
    }

    /// Whether the client is idle.
    pub(crate) fn is_idle(&self) -> bool {
        self.transfer.is_none()
    }

    /// Whether the transfer under way has begun more than once, so that an answer may come twice.
    pub(crate) fn is_repeating(&self) -> bool {
        self.transfer.is_some_and(|transfer| transfer.attempt > 1)
    }

    /// Begins a transfer anew after a silence of more than `timeout_ns`. Gives the transfer up after the last attempt.
    ///
    /// # Errors
    /// [`SdoFailure`] of the transfer that is given up.
    pub fn expire(&mut self, now_ns: u64, timeout_ns: u64) -> Result<(), SdoFailure> {
        let Some(transfer) = &mut self.transfer else { return Ok(()) };
        if transfer.sent_ns.is_none_or(|sent_ns| now_ns.saturating_sub(sent_ns) <= timeout_ns) {
            return Ok(());
        }
        // No second request for a segment: its answer would be the next segment.
        if transfer.attempt < ATTEMPTS && !matches!(transfer.action, Action::ReadSegment { .. }) {
            transfer.attempt += 1;
            transfer.sent_ns = None;
            return Ok(());
        }
        let object = transfer.object;
        (self.transfer, self.abort) = (None, Some((object, AbortCode::TIMED_OUT)));
        Err(SdoFailure { object, reason: SdoReason::Silent })
    }

    /// The request that is due, if any.
    pub fn poll(&mut self, now_ns: u64) -> Option<SdoRequest> {
        if let Some((object, code)) = self.abort.take() {
            return Some(SdoRequest::Abort { object, code });
        }
        let transfer = self.transfer.as_mut().filter(|transfer| transfer.sent_ns.is_none())?;
        transfer.sent_ns = Some(now_ns);
        let object = transfer.object;
        Some(match transfer.action {
            Action::Read => SdoRequest::InitiateUpload { object },
            Action::ReadSegment { toggle } => SdoRequest::UploadSegment { toggle },
            Action::Write(data) => SdoRequest::Download { object, data },
        })
    }

    /// Takes an answer of the server; returns the value read or written, or the failure of the transfer. Returns none
    /// for an answer without a request. Such answers follow a transfer begun twice or a repeated frame, or come from a
    /// second server with the same node id. The segments of a longer value go to `long`, and the value is then none;
    /// without `long` the client aborts.
    pub fn take_answer(
        &mut self,
        response: SdoResponse,
        mut long: Option<&mut Vec<u8>>,
    ) -> Option<Result<Option<Expedited>, SdoFailure>> {
        let Transfer { object, action, attempt, .. } =
            self.transfer.filter(|transfer| transfer.sent_ns.is_some())?;
        let is_long = long.as_ref().is_some_and(|long| long.len() <= LONGEST_VALUE);
        let next =
            |toggle| Transfer { object, action: Action::ReadSegment { toggle }, sent_ns: None, attempt };
        let outcome = match (response, action) {
            (SdoResponse::Abort { object: answered, code }, _) if answered == object => {
                Err(SdoFailure { object, reason: SdoReason::Aborted(code) })
            }
            (SdoResponse::Download { object: answered }, Action::Write(data)) if answered == object => {
                Ok(Some(data))
            }
            (SdoResponse::Upload { object: answered, data }, Action::Read) if answered == object => {
                Ok(Some(data))
            }
            (SdoResponse::InitiateUpload { object: answered, .. }, Action::Read) if answered == object => {
                if is_long {
                    self.transfer = Some(next(false));
                    return None;
                }
                Err(self.abort(object))
            }
            (
                SdoResponse::UploadSegment { toggle: answered, data, is_last },
                Action::ReadSegment { toggle },
            ) if answered == toggle => {
                if let Some(long) = &mut long {
                    long.extend_from_slice(data.data());
                }
                if !is_last && is_long {
                    self.transfer = Some(next(!toggle));
                    return None;
                }
                if is_last { Ok(None) } else { Err(self.abort(object)) }
            }
            _ => return None,
        };
        self.transfer = None;
        Some(outcome)
    }

    /// Aborts the read of a value that is too long.
    fn abort(&mut self, object: ObjectAddress) -> SdoFailure {
        self.abort = Some((object, AbortCode::LENGTH));
        SdoFailure { object, reason: SdoReason::Aborted(AbortCode::LENGTH) }
    }
}

/// A value of at most four bytes as an unsigned little-endian number.
pub fn number(bytes: &[u8]) -> u32 {
    bytes.iter().rfold(0, |number, &byte| number << 8 | u32::from(byte))
}
