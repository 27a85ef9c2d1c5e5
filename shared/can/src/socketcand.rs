//! The text protocol of socketcand in raw mode, for the server: access to a bus over TCP.
//!
//! After `< hi >` a client sends `< open can0 >` and `< rawmode >` and gets `< ok >` for each. From then on the client
//! gets `< frame … >` for every frame on the bus, and sends a frame with `< send … >`. There is no support for remote
//! frames and for the modes of broadcast management, statistics and ISO-TP. This module opens no sockets.
//!
//! Source: linux-can/socketcand, `doc/protocol.md`.

use std::fmt::{self, Write};

use crate::{CanId, Frame, FrameError, Received, frame::read_hex};

/// The first message of the server.
pub const GREETING: &str = "< hi >";
/// The answer to a granted request.
pub const OK: &str = "< ok >";
/// The answer to `< echo >`.
pub const ECHO: &str = "< echo >";

/// Hexadecimal digits of a 29-bit identifier; fewer digits mean 11 bits.
const EXTENDED_DIGITS: usize = 8;
/// The mark of a 29-bit identifier in the requests of some clients.
const EXTENDED_FLAG: u32 = 1 << 31;

/// Longest request, bytes.
const LONGEST_REQUEST: usize = 256;

/// A request of a client.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Request {
    /// Open a bus.
    Open(String),
    /// Receive every frame from now on.
    RawMode,
    /// Send a frame.
    Send(Frame),
    /// Check the connection.
    Echo,
}

/// The reason for the refusal of a request.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RequestError {
    /// No request of raw mode.
    #[error("unknown command '{0}': expected open, rawmode, send or echo")]
    Unknown(String),
    /// The number of bytes differs from the length field.
    #[error("data bytes announced: {announced}, sent: {sent}")]
    Length {
        /// The length field.
        announced: String,
        /// Data bytes that follow.
        sent: usize,
    },
    /// An identifier or a data byte is not a number.
    #[error("'{0}' is no number in hexadecimal digits")]
    Number(String),
    /// The frame cannot exist.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// Text that is no request, or a request without an end.
    #[error("text outside of angle brackets, or a request of more than {LONGEST_REQUEST} bytes")]
    Stray,
}

/// Requests that arrive in pieces over a stream.
///
/// ```
/// use masseter_can::socketcand::{Request, Requests};
///
/// let mut requests = Requests::default();
/// requests.push(b"< open can0 >< raw");
/// assert_eq!(requests.take(), Some(Ok(Request::Open("can0".to_owned()))));
/// assert_eq!(requests.take(), None);
/// requests.push(b"mode >");
/// assert_eq!(requests.take(), Some(Ok(Request::RawMode)));
/// ```
#[derive(Debug, Default)]
pub struct Requests {
    pending: Vec<u8>,
    /// The pending bytes belong to a request refused for its length.
    is_overlong: bool,
}

impl Requests {
    /// Adds received bytes.
    pub fn push(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    /// The next whole request, if there is one.
    ///
    /// # Errors
    /// [`RequestError`]; the refused bytes are dropped, and later requests are still read.
    pub fn take(&mut self) -> Option<Result<Request, RequestError>> {
        loop {
            let end = self.pending.iter().position(|byte| *byte == b'>');
            if !self.is_overlong && end.unwrap_or(self.pending.len()) > LONGEST_REQUEST {
                self.is_overlong = true;
                return Some(Err(RequestError::Stray));
            }
            let Some(end) = end else {
                if self.is_overlong {
                    self.pending.clear();
                }
                return None;
            };
            let bytes: Vec<u8> = self.pending.drain(..=end).collect();
            if !std::mem::take(&mut self.is_overlong) {
                return Some(parse_request(&bytes[..end]));
            }
        }
    }
}

/// A request from the bytes up to its closing bracket.
fn parse_request(bytes: &[u8]) -> Result<Request, RequestError> {
    let text = str::from_utf8(bytes).ok();
    let text = text.and_then(|text| text.trim_start().strip_prefix('<')).ok_or(RequestError::Stray)?;
    let text = text.trim();
    let words: Vec<&str> = text.split_whitespace().collect();
    match words[..] {
        ["open", bus] => Ok(Request::Open(bus.to_owned())),
        ["rawmode"] => Ok(Request::RawMode),
        ["echo"] => Ok(Request::Echo),
        ["send", id, length, ref data @ ..] => parse_send(id, length, data),
        _ => Err(RequestError::Unknown(text.to_owned())),
    }
}

fn parse_send(id: &str, length: &str, data: &[&str]) -> Result<Request, RequestError> {
    if length.parse() != Ok(data.len()) {
        return Err(RequestError::Length { announced: length.to_owned(), sent: data.len() });
    }
    // Clients with signed bytes write FFFFFFFFFFFFFF81 for 81: the lowest byte counts, as in the original.
    let byte = |text: &&str| parse_number(text).map(|number| number as u8);
    let data = data.iter().map(byte).collect::<Result<Vec<u8>, _>>()?;
    Ok(Request::Send(Frame::new(parse_id(id)?, &data)?))
}

/// Clients may omit leading zeros, so fewer digits than those of a 29-bit identifier mean 11 bits.
fn parse_id(text: &str) -> Result<CanId, RequestError> {
    let number = parse_number(text)?;
    let number = u32::try_from(number).map_err(|_| RequestError::Number(text.to_owned()))?;
    match text.len() {
        EXTENDED_DIGITS => Ok(CanId::extended(number & !EXTENDED_FLAG)?),
        _ => Ok(CanId::from_flagged(number)?),
    }
}

fn parse_number(text: &str) -> Result<u64, RequestError> {
    read_hex(text).ok_or_else(|| RequestError::Number(text.to_owned()))
}

/// Writes a received frame, with its time in whole microseconds.
///
/// # Errors
/// Errors of `out`.
pub fn write_frame(out: &mut impl Write, received: &Received) -> fmt::Result {
    let micros = received.time_ns / 1000;
    write!(out, "< frame {} {}.{:06} ", received.frame.id(), micros / 1_000_000, micros % 1_000_000)?;
    // No blanks between bytes, and two blanks for no bytes, because python-can splits at blanks.
    received.frame.data().iter().try_for_each(|byte| write!(out, "{byte:02X}"))?;
    out.write_str(" >")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::tests::any_frame;
    use proptest::prelude::*;

    fn requests(text: &str) -> Vec<Result<Request, RequestError>> {
        let mut requests = Requests::default();
        requests.push(text.as_bytes());
        std::iter::from_fn(|| requests.take()).collect()
    }

    fn sent(id: u16, data: &[u8]) -> Request {
        Request::Send(Frame::new(CanId::standard(id).unwrap(), data).unwrap())
    }

    #[test]
    fn requests_are_read_one_after_the_other() {
        let read = requests("< open can0 >< rawmode >\n< echo > < send 123 2 11 F1 >< send 080 0  >");
        let open = Request::Open("can0".to_owned());
        let expected = [open, Request::RawMode, Request::Echo, sent(0x123, &[0x11, 0xF1]), sent(0x080, &[])];
        assert_eq!(read, expected.map(Ok));
        let extended = Frame::fixed(CanId::extended(0x1AAA_AAAA).unwrap(), [1, 0xF1]);
        assert_eq!(requests("< send 1AAAAAAA 2 1 F1 >"), [Ok(Request::Send(extended))]);
    }

    #[test]
    fn numbers_are_read_as_loosely_as_clients_write_them() {
        assert_eq!(requests("< send 1 2 81 ffffffffffffff81 >"), [Ok(sent(0x001, &[0x81, 0x81]))]);
        assert_eq!(requests("< send 0000081 0 >"), [Ok(sent(0x081, &[]))]);
        let extended = Frame::fixed(CanId::extended(0x123).unwrap(), []);
        assert_eq!(
            requests("< send 80000123 0 >< send 00000123 0 >"),
            [extended; 2].map(Request::Send).map(Ok)
        );
    }

    #[test]
    fn an_invalid_request_is_an_error_and_the_next_request_is_read() {
        let table = [
            ("< bcmmode >", "unknown command"),
            ("< open >", "unknown command"),
            ("open can0 >", "outside"),
            ("\u{e9} >", "outside"),
            ("< send 123 3 11 22 >", "data bytes announced: 3, sent: 2"),
            ("< send 123 x >", "data bytes announced: x"),
            ("< send 123 1 1g >", "no number"),
            ("< send 123 1 -1 >", "no number"),
            ("< send 12x 0 >", "no number"),
            ("< send 112345678 0 >", "no number"),
            ("< send 800 0 >", "does not fit"),
            ("< send 1234567 0 >", "does not fit"),
            ("< send 20000000 0 >", "does not fit"),
            ("< send 123 9 1 2 3 4 5 6 7 8 9 >", "9 data bytes"),
        ];
        for (text, reason) in table {
            let read = requests(&format!("{text}< echo >"));
            let error = read[0].clone().unwrap_err().to_string();
            assert!(error.contains(reason), "{text}: {error}");
            assert_eq!(read[1..], [Ok(Request::Echo)]);
        }
        assert_eq!(requests(&"x".repeat(LONGEST_REQUEST + 1)), [Err(RequestError::Stray)]);
    }

    #[test]
    fn frames_are_written_as_clients_read_them() {
        let table = [
            (Frame::fixed(CanId::standard(0x123).unwrap(), [0x11, 0x02]), "< frame 123 23.424242 1102 >"),
            (Frame::fixed(CanId::standard(0x080).unwrap(), []), "< frame 080 23.424242  >"),
            (Frame::fixed(CanId::extended(0x123).unwrap(), [0xFF]), "< frame 00000123 23.424242 FF >"),
        ];
        for (frame, expected) in table {
            let mut text = String::new();
            write_frame(&mut text, &Received { frame, time_ns: 23_424_242_999 }).unwrap();
            assert_eq!(text, expected);
        }
    }

    #[test]
    fn a_request_that_is_too_long_is_one_error_in_one_piece_or_many() {
        let text = format!("< echo >< {} >< echo >", "x".repeat(2 * LONGEST_REQUEST));
        let expected = [Ok(Request::Echo), Err(RequestError::Stray), Ok(Request::Echo)];
        assert_eq!(requests(&text), expected);
        let mut in_pieces = Requests::default();
        let mut read = Vec::new();
        for byte in text.bytes() {
            in_pieces.push(&[byte]);
            read.extend(std::iter::from_fn(|| in_pieces.take()));
        }
        assert_eq!(read, expected);
    }

    proptest! {
        /// The frame arrives for every cut of the stream.
        #[test]
        fn a_frame_survives_any_cut(frame in any_frame(), cut in 0..40_usize) {
            let mut text = format!("< send {} {}", frame.id(), frame.data().len());
            frame.data().iter().for_each(|byte| write!(text, " {byte:x}").unwrap());
            text.push_str(" >");
            let (first, second) = text.split_at(cut.min(text.len() - 1));
            let mut requests = Requests::default();
            requests.push(first.as_bytes());
            prop_assert_eq!(requests.take(), None);
            requests.push(second.as_bytes());
            prop_assert_eq!(requests.take(), Some(Ok(Request::Send(frame))));
            prop_assert_eq!(requests.take(), None);
        }

        #[test]
        fn any_bytes_are_read_or_refused(bytes: Vec<u8>) {
            let mut requests = Requests::default();
            requests.push(&bytes);
            while requests.take().is_some() {}
        }
    }
}
