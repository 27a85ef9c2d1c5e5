//! candump log lines: `(1436509052.249713) vcan0 123#11223344`.
//!
//! Time stamps keep whole microseconds, as the format does. Error messages are written, but not read; remote frames are
//! refused.

use std::fmt::{self, Write};

use super::error_frame::ErrorReport;
use super::frame::{Frame, FrameError, FrameFormat};
use super::id::{CanIdError, digits};
use super::tap::{self, TapError, Tapped};
use crate::messages::FrameTap;

/// One line, read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a> {
    /// Time, a multiple of 1000 ns.
    pub time_ns: u64,
    /// Name of the interface.
    pub interface: &'a str,
    /// The frame.
    pub frame: Frame,
}

/// Why a line is none of a candump log.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CandumpError {
    /// Not three fields.
    #[error("`{line}` is not of the form `(seconds.micros) interface id#data`")]
    Fields {
        /// The line.
        line: String,
    },
    /// The time is none.
    #[error("`{text}` is no time of the form `(seconds.micros)` with six decimals")]
    Time {
        /// The first field.
        text: String,
    },
    /// What stands before `#` is no identifier.
    #[error(transparent)]
    Id(#[from] CanIdError),
    /// The data are no whole bytes.
    #[error("`{text}` is no data of whole bytes in hexadecimal digits (remote frames are refused)")]
    Data {
        /// What stands behind `#`.
        text: String,
    },
    /// An FD frame without flags.
    #[error("`{text}` does not begin with the flag digit of an FD frame")]
    Flags {
        /// What stands behind the first `#`.
        text: String,
    },
    /// The frame cannot exist.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

/// Writes one line, without line end. Fractions of a microsecond are cut off.
///
/// # Errors
/// What `out` fails with.
pub fn write(out: &mut impl Write, time_ns: u64, interface: impl fmt::Display, frame: &Frame) -> fmt::Result {
    write_stamp(out, time_ns, interface)?;
    write!(out, "{frame}")
}

/// Writes one line for what a tap saw.
///
/// # Errors
/// [`TapError`] where the message holds neither frame nor error report; nothing is written then.
pub fn write_tap(line: &mut String, interface: &str, tap: &FrameTap) -> Result<(), TapError> {
    match tap::decode(tap)? {
        Tapped::Frame(received) => write(line, received.time_ns, interface, &received.frame),
        Tapped::Error(report) => write_error(line, interface, &report),
    }
    .expect("writing to a string does not fail");
    Ok(())
}

/// An error report goes in as the error message that a `SocketCAN` interface would give.
fn write_error(out: &mut impl Write, interface: impl fmt::Display, report: &ErrorReport) -> fmt::Result {
    let (id, data) = report.encode();
    write_stamp(out, report.time_ns, interface)?;
    write!(out, "{id:08X}#")?;
    data.iter().try_for_each(|byte| write!(out, "{byte:02X}"))
}

fn write_stamp(out: &mut impl Write, time_ns: u64, interface: impl fmt::Display) -> fmt::Result {
    let micros = time_ns / 1000;
    write!(out, "({}.{:06}) {interface} ", micros / 1_000_000, micros % 1_000_000)
}

/// Reads one line.
///
/// # Errors
/// [`CandumpError`] with the field that cannot be read.
pub fn parse(line: &str) -> Result<Line<'_>, CandumpError> {
    let fields = || CandumpError::Fields { line: line.to_owned() };
    let mut words = line.split_whitespace();
    let (Some(time), Some(interface), Some(frame), None) =
        (words.next(), words.next(), words.next(), words.next())
    else {
        return Err(fields());
    };
    let (id, data) = frame.split_once('#').ok_or_else(fields)?;
    let (data, format) = match data.strip_prefix('#') {
        Some(flagged) => split_flags(flagged).ok_or_else(|| CandumpError::Flags { text: data.to_owned() })?,
        None => (data, FrameFormat::Classical),
    };
    Ok(Line { time_ns: parse_time(time)?, interface, frame: parse_frame(id, format, data)? })
}

/// The flag digit of an FD frame and what follows it; the error state indicator (2) and FDF itself (4), which
/// newer candumps write, do not matter here.
fn split_flags(flagged: &str) -> Option<(&str, FrameFormat)> {
    let flags = digits(flagged.get(..1)?, 16)?;
    let format = if flags & 1 == 1 { FrameFormat::FdBitRateSwitch } else { FrameFormat::Fd };
    Some((&flagged[1..], format))
}

fn parse_time(text: &str) -> Result<u64, CandumpError> {
    let nanoseconds = || {
        let (seconds, micros) = text.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
        if micros.len() != 6 {
            return None;
        }
        let seconds_ns = digits(seconds, 10)?.checked_mul(1_000_000_000)?;
        seconds_ns.checked_add(digits(micros, 10)? * 1000)
    };
    nanoseconds().ok_or_else(|| CandumpError::Time { text: text.to_owned() })
}

fn parse_frame(id: &str, format: FrameFormat, data: &str) -> Result<Frame, CandumpError> {
    let wrong_data = || CandumpError::Data { text: data.to_owned() };
    let (pairs, []) = data.as_bytes().as_chunks::<2>() else { return Err(wrong_data()) };
    format.check(pairs.len())?;
    let mut bytes = [0; Frame::MAX_DATA];
    let used = &mut bytes[..pairs.len()];
    for (byte, pair) in used.iter_mut().zip(pairs) {
        let value = str::from_utf8(pair).ok().and_then(|pair| digits(pair, 16));
        *byte = value.ok_or_else(wrong_data)? as u8;
    }
    Ok(Frame::with_format(id.parse()?, format, used)?)
}

#[cfg(test)]
mod tests {
    use super::super::frame::strategies::any_frame;
    use super::super::id::CanId;
    use super::*;
    use crate::messages::CanData;
    use proptest::prelude::*;

    const EXAMPLE: &str = "(1436509052.249713) vcan0 123#11223344";

    #[test]
    fn the_example_of_can_utils_reads_and_writes() {
        let line = parse(EXAMPLE).unwrap();
        let frame = Frame::fixed(CanId::standard(0x123).unwrap(), [0x11, 0x22, 0x33, 0x44]);
        assert_eq!(line, Line { time_ns: 1_436_509_052_249_713_000, interface: "vcan0", frame });
        let mut written = String::new();
        write(&mut written, line.time_ns, line.interface, &line.frame).unwrap();
        assert_eq!(written, EXAMPLE);
    }

    #[test]
    fn what_cannot_be_read_is_told() {
        let table = [
            ("(1.000000) can0", "is not of the form"),
            ("(1.000000) can0 123", "is not of the form"),
            ("1.000000 can0 123#", "no time"),
            ("(1.0) can0 123#", "no time"),
            ("(+1.000000) can0 123#", "no time"),
            ("(99999999999.000000) can0 123#", "no time"),
            ("(1.000000) can0 12#", "no identifier"),
            ("(1.000000) can0 +12#", "no identifier"),
            ("(1.000000) can0 800#", "does not fit into 11 bits"),
            ("(1.000000) can0 FFFFFFFF#", "does not fit into 29 bits"),
            ("(1.000000) can0 123#R", "no data"),
            ("(1.000000) can0 123##", "flag digit"),
            ("(1.000000) can0 123#1g", "no data"),
            ("(1.000000) can0 123#é", "no data"),
            ("(1.000000) can0 123#001122334455667788", "9 data bytes"),
            ("(1.000000) can0 123##1001122334455667788", "9 data bytes"),
        ];
        for (line, reason) in table {
            let error = parse(line).unwrap_err().to_string();
            assert!(error.contains(reason), "{line}: {error}");
        }
    }

    #[test]
    fn a_tap_that_holds_no_frame_writes_nothing() {
        let mut line = String::new();
        let tap = FrameTap { data: CanData::padded([0; 64], 9), ..Default::default() };
        assert_eq!(write_tap(&mut line, "can0", &tap), Err(FrameError::DataLength { length: 9 }.into()));
        assert_eq!(line, "");
    }

    proptest! {
        #[test]
        fn every_frame_survives(
            frame in any_frame(),
            micros in 0..=u64::MAX / 1000,
            bus: u16,
        ) {
            let time_ns = micros * 1000;
            let mut line = String::new();
            write(&mut line, time_ns, format_args!("can{bus}"), &frame).unwrap();
            let interface = format!("can{bus}");
            prop_assert_eq!(parse(&line), Ok(Line { time_ns, interface: &interface, frame }));
        }

        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            let _ = parse(&text);
        }
    }
}
