//! The observations of a tap on a bus: frames and errors, each with its time.
//!
//! The coding of errors is that of `SocketCAN`'s error messages (`linux/can/error.h`). The identifier has the flag
//! 2000_0000h and the class; the data bytes have the details, bytes 6 and 7 the error counters. Byte 5, which the
//! kernel leaves to the driver, holds the port. Overload frames, lost arbitration and line faults are not represented.

use libc::{CAN_ERR_ACK, CAN_ERR_BUSERROR, CAN_ERR_BUSOFF, CAN_ERR_CNT, CAN_ERR_CRTL, CAN_ERR_PROT};

use crate::{BusStatus, ErrorState, Frame, Received};

/// An observation of a tap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Tapped {
    /// A frame.
    Frame(TappedFrame),
    /// An error on the wire, or a controller that changed its error state.
    Error(ErrorReport),
}

/// A frame with its times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct TappedFrame {
    /// The frame.
    pub frame: Frame,
    /// Time of the last end-of-frame bit on the wire, ns.
    pub time_ns: u64,
    /// Time at which the transmitter queued the frame, ns; `None` on real wires.
    pub queued_ns: Option<u64>,
}

impl From<Received> for TappedFrame {
    fn from(Received { frame, time_ns }: Received) -> Self {
        Self { frame, time_ns, queued_ns: None }
    }
}

impl Tapped {
    /// Time of the observation, ns.
    pub fn time_ns(&self) -> u64 {
        match self {
            Self::Frame(tapped) => tapped.time_ns,
            Self::Error(report) => report.time_ns,
        }
    }

    /// The frame, if the observation is one.
    pub fn frame(&self) -> Option<&TappedFrame> {
        match self {
            Self::Frame(tapped) => Some(tapped),
            Self::Error(_) => None,
        }
    }
}

/// Identifier flag of an error message.
pub const ERROR_FLAG: u32 = 1 << 29;

const RECEIVE_PASSIVE: u8 = 0x10;
const TRANSMIT_PASSIVE: u8 = 0x20;
const ACTIVE: u8 = 0x40;
const BIT_ERROR_IN_TRANSMISSION: u8 = 0x81;

/// The kind of an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum ErrorKind {
    /// An error frame has destroyed a frame.
    Bit,
    /// No node has acknowledged a frame, and an error frame has ended the frame.
    Acknowledge,
    /// A controller has changed its error state.
    State(ErrorState),
}

/// An error as a tap reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ErrorReport {
    /// Time of the error: the end of an error frame's delimiter, or the change of state, ns.
    pub time_ns: u64,
    /// The port of the transmitter, or of the controller with the changed state.
    pub port: u8,
    /// The kind of the error.
    pub kind: ErrorKind,
    /// Transmit error counter after the error, at most 255.
    pub tec: u8,
    /// Receive error counter after the error.
    pub rec: u8,
}

/// An error message of an unsupported class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("error message {0:X}h is of an unsupported class")]
pub struct ErrorReportError(pub u32);

impl ErrorReport {
    /// A report on a port of that status.
    pub fn new(time_ns: u64, port: u8, kind: ErrorKind, status: BusStatus) -> Self {
        let byte = |counter: u16| counter.min(u16::from(u8::MAX)) as u8;
        Self { time_ns, port, kind, tec: byte(status.tec), rec: byte(status.rec) }
    }

    /// Identifier with flag, and data bytes.
    pub fn encode(&self) -> (u32, [u8; 8]) {
        let (class, controller, protocol) = match self.kind {
            ErrorKind::Bit => (CAN_ERR_PROT | CAN_ERR_BUSERROR, 0, BIT_ERROR_IN_TRANSMISSION),
            ErrorKind::Acknowledge => (CAN_ERR_ACK | CAN_ERR_BUSERROR, 0, 0),
            ErrorKind::State(ErrorState::Active) => (CAN_ERR_CRTL, ACTIVE, 0),
            ErrorKind::State(ErrorState::Passive) if self.tec > 127 => (CAN_ERR_CRTL, TRANSMIT_PASSIVE, 0),
            ErrorKind::State(ErrorState::Passive) => (CAN_ERR_CRTL, RECEIVE_PASSIVE, 0),
            ErrorKind::State(ErrorState::BusOff) => (CAN_ERR_BUSOFF, 0, 0),
        };
        let data = [0, controller, protocol, 0, 0, self.port, self.tec, self.rec];
        (ERROR_FLAG | CAN_ERR_CNT | class, data)
    }

    /// Reads identifier and data bytes.
    ///
    /// # Errors
    /// [`ErrorReportError`] for classes that are not represented.
    pub fn decode(time_ns: u64, id: u32, data: [u8; 8]) -> Result<Self, ErrorReportError> {
        let [_, controller, _, _, _, port, tec, rec] = data;
        let has = |class| id & ERROR_FLAG != 0 && id & class != 0;
        let kind = if has(CAN_ERR_BUSOFF) {
            ErrorKind::State(ErrorState::BusOff)
        } else if has(CAN_ERR_CRTL) && controller & (TRANSMIT_PASSIVE | RECEIVE_PASSIVE) != 0 {
            ErrorKind::State(ErrorState::Passive)
        } else if has(CAN_ERR_CRTL) && controller & ACTIVE != 0 {
            ErrorKind::State(ErrorState::Active)
        } else if has(CAN_ERR_ACK) {
            ErrorKind::Acknowledge
        } else if has(CAN_ERR_PROT) {
            ErrorKind::Bit
        } else {
            return Err(ErrorReportError(id));
        };
        Ok(Self { time_ns, port, kind, tec, rec })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_are_coded_as_the_kernel_does() {
        let report = |kind, tec| ErrorReport { time_ns: 7, port: 3, kind, tec, rec: 1 };
        let table = [
            (report(ErrorKind::Bit, 8), 0x2000_0288, [0, 0, 0x81, 0, 0, 3, 8, 1]),
            (report(ErrorKind::Acknowledge, 8), 0x2000_02A0, [0, 0, 0, 0, 0, 3, 8, 1]),
            (report(ErrorKind::State(ErrorState::Active), 0), 0x2000_0204, [0, 0x40, 0, 0, 0, 3, 0, 1]),
            (report(ErrorKind::State(ErrorState::Passive), 128), 0x2000_0204, [0, 0x20, 0, 0, 0, 3, 128, 1]),
            (report(ErrorKind::State(ErrorState::BusOff), 255), 0x2000_0240, [0, 0, 0, 0, 0, 3, 255, 1]),
        ];
        for (report, id, data) in table {
            assert_eq!(report.encode(), (id, data));
            assert_eq!(ErrorReport::decode(7, id, data), Ok(report));
        }
        assert_eq!(ErrorReport::decode(7, 0x2000_0001, [0; 8]), Err(ErrorReportError(0x2000_0001)));
    }
}
