//! Errors on the wire and changes of a controller's error state, as a tap reports them.
//!
//! The coding is that of `SocketCAN`'s error messages (`linux/can/error.h`): identifier flag 2000_0000h with the class,
//! details in the data bytes, error counters in bytes 6 and 7. Byte 5, which the kernel leaves to the driver, holds the
//! port. Overload frames, lost arbitration and line faults are not represented.

use super::bus::{BusStatus, ErrorState};

/// Identifier flag of an error message.
pub const ERROR_FLAG: u32 = 1 << 29;

const CONTROLLER: u32 = 0x004;
const PROTOCOL: u32 = 0x008;
const ACKNOWLEDGE: u32 = 0x020;
const BUS_OFF: u32 = 0x040;
const BUS_ERROR: u32 = 0x080;
const COUNTERS: u32 = 0x200;

const RECEIVE_PASSIVE: u8 = 0x10;
const TRANSMIT_PASSIVE: u8 = 0x20;
const ACTIVE: u8 = 0x40;
const BIT_ERROR_IN_TRANSMISSION: u8 = 0x81;

/// The kind of an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// A frame was destroyed by an error frame.
    Bit,
    /// No node acknowledged a frame, which ended in an error frame.
    Acknowledge,
    /// A controller changed its error state.
    State(ErrorState),
}

/// An error as a tap reports it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ErrorReport {
    /// Time of the error: the end of an error frame's delimiter, or the change of state, ns.
    pub time_ns: u64,
    /// The port: of the transmitter, or of the controller whose state changed.
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
#[error("error message {id:X}h is of an unsupported class")]
pub struct ErrorReportError {
    /// The identifier with its flag.
    pub id: u32,
}

impl ErrorReport {
    /// A report on a port of that status.
    pub fn new(time_ns: u64, port: u8, kind: ErrorKind, status: BusStatus) -> Self {
        let byte = |counter: u16| counter.min(u16::from(u8::MAX)) as u8;
        Self { time_ns, port, kind, tec: byte(status.tec), rec: byte(status.rec) }
    }

    /// Identifier with flag, and data bytes.
    pub fn encode(&self) -> (u32, [u8; 8]) {
        let (class, controller, protocol) = match self.kind {
            ErrorKind::Bit => (PROTOCOL | BUS_ERROR, 0, BIT_ERROR_IN_TRANSMISSION),
            ErrorKind::Acknowledge => (ACKNOWLEDGE | BUS_ERROR, 0, 0),
            ErrorKind::State(ErrorState::Active) => (CONTROLLER, ACTIVE, 0),
            ErrorKind::State(ErrorState::Passive) if self.tec > 127 => (CONTROLLER, TRANSMIT_PASSIVE, 0),
            ErrorKind::State(ErrorState::Passive) => (CONTROLLER, RECEIVE_PASSIVE, 0),
            ErrorKind::State(ErrorState::BusOff) => (BUS_OFF, 0, 0),
        };
        let data = [0, controller, protocol, 0, 0, self.port, self.tec, self.rec];
        (ERROR_FLAG | COUNTERS | class, data)
    }

    /// Reads identifier and data bytes.
    ///
    /// # Errors
    /// [`ErrorReportError`] for classes that are not represented.
    pub fn decode(time_ns: u64, id: u32, data: [u8; 8]) -> Result<Self, ErrorReportError> {
        let [_, controller, _, _, _, port, tec, rec] = data;
        let has = |class| id & ERROR_FLAG != 0 && id & class != 0;
        let kind = if has(BUS_OFF) {
            ErrorKind::State(ErrorState::BusOff)
        } else if has(CONTROLLER) && controller & (TRANSMIT_PASSIVE | RECEIVE_PASSIVE) != 0 {
            ErrorKind::State(ErrorState::Passive)
        } else if has(CONTROLLER) && controller & ACTIVE != 0 {
            ErrorKind::State(ErrorState::Active)
        } else if has(ACKNOWLEDGE) {
            ErrorKind::Acknowledge
        } else if has(PROTOCOL) {
            ErrorKind::Bit
        } else {
            return Err(ErrorReportError { id });
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
        assert_eq!(ErrorReport::decode(7, 0x2000_0001, [0; 8]), Err(ErrorReportError { id: 0x2000_0001 }));
    }
}
