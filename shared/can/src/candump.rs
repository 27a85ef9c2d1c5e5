//! candump log lines: `(1436509052.249713) vcan0 123#11223344`.
//!
//! Time stamps have whole microseconds, as in the format. This module writes logs and does not read them.

use std::fmt::{self, Write};

use super::tap::Tapped;

/// Writes one line without line end. Fractions of a microsecond are cut off. An error report becomes the error
/// message that a `SocketCAN` interface would give.
///
/// # Errors
/// Those of `out`.
///
/// # Examples
/// ```
/// use masseter_can::{CanId, Frame, Received, Tapped, candump};
///
/// let frame = Frame::fixed(CanId::standard(0x123)?, [0x11, 0x22]);
/// let mut line = String::new();
/// candump::write(&mut line, "can0", &Tapped::Frame(Received { frame, time_ns: 1_500_000 }.into()))?;
/// assert_eq!(line, "(0.001500) can0 123#1122");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(out: &mut impl Write, interface: &str, tapped: &Tapped) -> fmt::Result {
    let micros = tapped.time_ns() / 1000;
    write!(out, "({}.{:06}) {interface} ", micros / 1_000_000, micros % 1_000_000)?;
    match tapped {
        Tapped::Frame(tapped) => write!(out, "{}", tapped.frame),
        Tapped::Error(report) => {
            let (id, data) = report.encode();
            write!(out, "{id:08X}#")?;
            data.iter().try_for_each(|byte| write!(out, "{byte:02X}"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CanId, ErrorKind, ErrorReport, ErrorState, Frame, Received};

    fn line(time_ns: u64, frame: Frame) -> String {
        let mut line = String::new();
        write(&mut line, "vcan0", &Tapped::Frame(Received { frame, time_ns }.into())).unwrap();
        line
    }

    #[test]
    fn the_example_of_can_utils_is_written() {
        let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x11, 0x22, 0x33, 0x44]);
        assert_eq!(line(1_436_509_052_249_713_999, frame), "(1436509052.249713) vcan0 123#11223344");
    }

    #[test]
    fn extended_and_empty_frames_are_written_as_candump_does() {
        let extended = CanId::extended(0x123).unwrap();
        assert_eq!(line(0, Frame::fixed(extended, [])), "(0.000000) vcan0 00000123#");
    }

    #[test]
    fn an_error_report_becomes_the_message_of_the_kernel() {
        let kind = ErrorKind::State(ErrorState::BusOff);
        let report = ErrorReport { time_ns: 5000, port: 2, kind, tec: 255, rec: 3 };
        let mut line = String::new();
        write(&mut line, "can1", &Tapped::Error(report)).unwrap();
        assert_eq!(line, "(0.000005) can1 20000240#000000000002FF03");
    }
}
