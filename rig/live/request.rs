//! What a new connection wants, read from its request without taking the request off the connection.

use std::net::TcpStream;

use masseter_shared::clock;
use tungstenite::handshake::server::Request;
use tungstenite::http::header::UPGRADE;

use super::queue::{Disconnected, INTERVAL};

/// Longest request, bytes.
const MOST: usize = 8192;
/// Most headers of a request.
const HEADERS: usize = 64;

/// A request, and its length on the connection.
pub(super) struct Peeked {
    pub request: Request,
    pub length: usize,
}

impl Peeked {
    /// Waits for a whole request. The server shuts a connection down that takes too long.
    pub(super) fn wait(stream: &TcpStream) -> Result<Self, Disconnected> {
        let mut buffer = [0; MOST];
        loop {
            let available = stream.peek(&mut buffer)?;
            if available == 0 {
                return Err(Disconnected);
            }
            if let Some(peeked) = parse(&buffer[..available])? {
                return Ok(peeked);
            }
            if available == MOST {
                return Err(Disconnected);
            }
            clock::sleep(INTERVAL);
        }
    }

    /// Whether the client wants a WebSocket; otherwise a page.
    pub(super) fn is_for_socket(&self) -> bool {
        let upgrade = self.request.headers().get(UPGRADE).and_then(|upgrade| upgrade.to_str().ok());
        upgrade.is_some_and(|upgrade| upgrade.eq_ignore_ascii_case("websocket"))
    }
}

/// None where the request has not come completely.
fn parse(bytes: &[u8]) -> Result<Option<Peeked>, Disconnected> {
    let mut headers = [httparse::EMPTY_HEADER; HEADERS];
    let mut parsed = httparse::Request::new(&mut headers);
    let httparse::Status::Complete(length) = parsed.parse(bytes).map_err(|_| Disconnected)? else {
        return Ok(None);
    };
    let mut request = Request::builder().method(parsed.method.unwrap_or("")).uri(parsed.path.unwrap_or(""));
    for header in parsed.headers.iter() {
        request = request.header(header.name, header.value);
    }
    let request = request.body(()).map_err(|_| Disconnected)?;
    Ok(Some(Peeked { request, length }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_request_is_complete_with_its_empty_line() {
        let whole = b"GET /5ec7e7 HTTP/1.1\r\nHost: localhost\r\nUpgrade: WebSocket\r\n\r\n";
        assert!(parse(&whole[..whole.len() - 1]).is_ok_and(|peeked| peeked.is_none()));
        let Ok(Some(peeked)) = parse(whole) else { panic!("no request") };
        assert_eq!((peeked.length, peeked.request.uri().path()), (whole.len(), "/5ec7e7"));
        assert!(peeked.is_for_socket());
        assert!(parse(b"\x16\x03\x01 TLS").is_err());
    }
}
