//! Logs of candump (can-utils): lines such as `(1436509052.249713) vcan0 123#11223344`.
//!
//! Time stamps are written with whole microseconds. The module reads what `candump -l` and `candump -L` write, and `#` at
//! the start of a line begins a comment. Remote frames, CAN FD, and error messages that [`ErrorReport`] does not
//! represent are refused. Nothing here opens a file.

use std::fmt::{self, Write};

use crate::frame::read_hex;
use crate::tap::{ERROR_FLAG, ErrorReport, ErrorReportError, Tapped};
use crate::{CanId, Frame, FrameError, Received};

/// Writes one line without line end. Fractions of a microsecond are cut off. An error report becomes the error
/// message of a `SocketCAN` interface.
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

/// A line of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Line<'a> {
    /// Its number in the log, from 1.
    pub number: usize,
    /// The interface.
    pub interface: &'a str,
    /// What was seen there.
    pub tapped: Tapped,
}

/// A line that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {number}: {reason}")]
pub struct ReadError {
    /// Its number in the log, from 1.
    pub number: usize,
    /// Why.
    pub reason: LineError,
}

/// Why a line cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LineError {
    /// Another format.
    #[error("expected '(SECONDS) INTERFACE ID#DATA', as 'candump -l' and 'candump -L' write it")]
    Format,
    /// Candump reports that it was too slow.
    #[error("candump has lost frames here; record the log again, with a larger buffer (candump -r)")]
    LostFrames,
    /// A time that is no number, or beyond 584 years.
    #[error("'{0}' is no time in seconds")]
    Time(String),
    /// Neither a data frame of classical CAN nor an error message.
    #[error(
        "'{0}' is no data frame of classical CAN; remote frames and CAN FD are not represented, remove them"
    )]
    Frame(String),
    /// The frame cannot exist.
    #[error(transparent)]
    Impossible(#[from] FrameError),
    /// An error message without a representation.
    #[error("{0}; remove it")]
    ErrorMessage(#[from] ErrorReportError),
}

/// Reads a log. Blank lines and comments are left out, but count.
///
/// # Examples
/// ```
/// use masseter_can::candump;
///
/// let log = "# two frames\n(1.000048) can0 080#\n(1.000200) can1 701#00\n";
/// let lines: Vec<_> = candump::read(log).collect::<Result<_, _>>()?;
/// assert_eq!((lines[1].number, lines[1].interface), (3, "can1"));
/// assert_eq!(lines[1].tapped.time_ns(), 1_000_200_000);
///
/// let cut = candump::read("(1.000048) can0 080").next().unwrap();
/// assert!(cut.unwrap_err().to_string().starts_with("line 1: expected '(SECONDS) INTERFACE ID#DATA'"));
/// # Ok::<(), candump::ReadError>(())
/// ```
pub fn read(log: &str) -> impl Iterator<Item = Result<Line<'_>, ReadError>> {
    let lines = log.lines().zip(1..).map(|(line, number)| (line.trim(), number));
    lines.filter(|(line, _)| !line.is_empty() && !line.starts_with('#')).map(|(line, number)| {
        let (interface, tapped) = read_line(line).map_err(|reason| ReadError { number, reason })?;
        Ok(Line { number, interface, tapped })
    })
}

fn read_line(line: &str) -> Result<(&str, Tapped), LineError> {
    if line.starts_with("DROPCOUNT") {
        return Err(LineError::LostFrames);
    }
    let words: Vec<_> = line.split_whitespace().collect();
    // Newer versions add the direction.
    let ([time, interface, frame] | [time, interface, frame, "R" | "T"]) = words[..] else {
        return Err(LineError::Format);
    };
    let (id, data) = frame.split_once('#').ok_or(LineError::Format)?;
    let time_ns = read_time(time).ok_or_else(|| LineError::Time(time.to_owned()))?;
    let no_frame = || LineError::Frame(frame.to_owned());
    // `candump -8` adds the length code above 8.
    let data = match data.split_once('_') {
        None => data,
        Some((data, code)) if data.len() == 16 && code.len() == 1 && read_hex(code).is_some() => data,
        Some(_) => return Err(no_frame()),
    };
    let data = read_data(data).ok_or_else(no_frame)?;
    let number = read_hex(id).and_then(|number| u32::try_from(number).ok()).ok_or_else(no_frame)?;
    if number & ERROR_FLAG != 0 {
        let details = data.try_into().map_err(|_| no_frame())?;
        return Ok((interface, Tapped::Error(ErrorReport::decode(time_ns, number, details)?)));
    }
    let id = match id.len() {
        3 => CanId::standard(number as u16)?,
        8 => CanId::extended(number)?,
        _ => return Err(no_frame()),
    };
    Ok((interface, Tapped::Frame(Received { frame: Frame::new(id, &data)?, time_ns }.into())))
}

/// `(SECONDS.FRACTION)`, ns.
fn read_time(text: &str) -> Option<u64> {
    let (seconds, fraction) = text.strip_prefix('(')?.strip_suffix(')')?.split_once('.')?;
    let is_number = |digits: &str| digits.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(seconds) || !is_number(fraction) || !(1..=9).contains(&fraction.len()) {
        return None;
    }
    let ns: u64 = format!("{fraction:0<9}").parse().ok()?;
    seconds.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(ns)
}

fn read_data(digits: &str) -> Option<Vec<u8>> {
    let bytes = digits.as_bytes().chunks(2);
    bytes
        .map(|pair| Some(read_hex(str::from_utf8(pair).ok().filter(|pair| pair.len() == 2)?)? as u8))
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::tests::any_frame;
    use crate::{ErrorKind, ErrorState};

    fn line(interface: &str, tapped: &Tapped) -> String {
        let mut line = String::new();
        write(&mut line, interface, tapped).unwrap();
        line
    }

    fn tapped(time_ns: u64, frame: Frame) -> Tapped {
        Tapped::Frame(Received { frame, time_ns }.into())
    }

    fn read_one(line: &str) -> Result<(String, Tapped), LineError> {
        let mut lines = read(line);
        let read = lines.next().expect("a line");
        assert!(lines.next().is_none());
        read.map(|line| (line.interface.to_owned(), line.tapped)).map_err(|error| error.reason)
    }

    fn example() -> Frame {
        Frame::fixed(CanId::standard(0x123).unwrap(), [0x11, 0x22, 0x33, 0x44])
    }

    #[test]
    fn the_example_of_can_utils_is_written() {
        let text = line("vcan0", &tapped(1_436_509_052_249_713_999, example()));
        assert_eq!(text, "(1436509052.249713) vcan0 123#11223344");
    }

    #[test]
    fn extended_and_empty_frames_are_written_as_candump_does() {
        let extended = CanId::extended(0x123).unwrap();
        assert_eq!(line("vcan0", &tapped(0, Frame::fixed(extended, []))), "(0.000000) vcan0 00000123#");
    }

    #[test]
    fn an_error_report_becomes_the_message_of_the_kernel() {
        let kind = ErrorKind::State(ErrorState::BusOff);
        let report = Tapped::Error(ErrorReport { time_ns: 5000, port: 2, kind, tec: 255, rec: 3 });
        assert_eq!(line("can1", &report), "(0.000005) can1 20000240#000000000002FF03");
        assert_eq!(read_one("(0.000005) can1 20000240#000000000002FF03"), Ok(("can1".to_owned(), report)));
    }

    #[test]
    fn every_version_of_candump_is_read() {
        let expected = |time_ns| Ok(("vcan0".to_owned(), tapped(time_ns, example())));
        let ns = 1_436_509_052_249_713_000;
        assert_eq!(read_one("(1436509052.249713) vcan0 123#11223344"), expected(ns));
        assert_eq!(read_one("(1436509052.249713)  vcan0 123#11223344\r"), expected(ns), "padded name");
        assert_eq!(read_one("(1436509052.249713) vcan0 123#11223344 T"), expected(ns), "direction");
        assert_eq!(read_one("(0000000002.5) vcan0 123#11223344"), expected(2_500_000_000));
        assert_eq!(read_one("(1436509052.249713001) vcan0 123#11223344"), expected(ns + 1), "candump -N");
        let full = Frame::fixed(CanId::standard(0x123).unwrap(), [0xAB; 8]);
        let text = "(0.000001) can0 123#ABABABABABABABAB_F";
        assert_eq!(read_one(text), Ok(("can0".to_owned(), tapped(1000, full))), "candump -8");
    }

    #[test]
    fn a_line_that_cannot_be_read_is_named_with_its_reason() {
        let table = [
            ("can0  123   [2]  11 22", "expected '(SECONDS) INTERFACE ID#DATA'"),
            ("(1.0) can0 123", "expected '(SECONDS)"),
            ("(1.0) can0 123#11 X", "expected '(SECONDS)"),
            ("DROPCOUNT: dropped 3 CAN frames on 'can0' socket (total drops 3)", "lost frames"),
            ("(2024-01-01) can0 123#", "'(2024-01-01)' is no time"),
            ("(+1.0) can0 123#", "no time"),
            ("(1.0000000000) can0 123#", "no time"),
            ("(99999999999999999999.0) can0 123#", "no time"),
            ("(1.0) can0 123#R2", "'123#R2' is no data frame"),
            ("(1.0) can0 123##111", "no data frame"),
            ("(1.0) can0 123#1", "no data frame"),
            ("(1.0) can0 123#+1", "no data frame"),
            ("(1.0) can0 123#AB_9", "no data frame"),
            ("(1.0) can0 123#ABABABABABABABAB_zz", "no data frame"),
            ("(1.0) can0 1234#11", "no data frame"),
            ("(1.0) can0 1é3#é1", "no data frame"),
            ("(1.0) can0 20000240#11", "no data frame"),
            ("(1.0) can0 FFF#11", "identifier FFFh does not fit into 11 bits"),
            ("(1.0) can0 123#112233445566778899", "9 data bytes"),
            (
                "(1.0) can0 20000100#0000000000000000",
                "error message 20000100h is of an unsupported class; remove",
            ),
        ];
        for (text, reason) in table {
            let error = read(&format!("\n# note\n{text}")).next().unwrap().unwrap_err().to_string();
            assert!(error.starts_with("line 3: ") && error.contains(reason), "{text}: {error}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(frames in prop::collection::vec((any_frame(), 0..u64::MAX / 1000), 0..20)) {
            let all: Vec<_> = frames.into_iter().map(|(frame, micros)| tapped(micros * 1000, frame)).collect();
            let log: String = all.iter().map(|tapped| line("can0", tapped) + "\n").collect();
            let read: Vec<_> = read(&log).map(|line| line.unwrap().tapped).collect();
            prop_assert_eq!(read, all);
        }

        #[test]
        fn any_text_is_read_or_refused(text: String) {
            read(&text).for_each(drop);
        }
    }
}
