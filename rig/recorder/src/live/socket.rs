//! A WebSocket to a client.

use std::io::ErrorKind;
use std::net::TcpStream;

use tungstenite::Error;
use tungstenite::protocol::frame::{CloseFrame, coding::CloseCode};
use tungstenite::protocol::{Message, Role, WebSocket, WebSocketConfig};

use super::queue::Disconnected;

/// The longest message from a client, bytes; clients only ask.
const MAX_REQUEST_BYTES: usize = 1 << 16;

/// A WebSocket whose reads end after a moment.
pub(super) struct Socket(WebSocket<TcpStream>);

impl Socket {
    /// A connection with a time-out for reads, whose handshake is done. The client has sent `behind` already.
    pub(super) fn new(stream: TcpStream, behind: Vec<u8>) -> Self {
        let config = WebSocketConfig::default()
            .max_message_size(Some(MAX_REQUEST_BYTES))
            .max_frame_size(Some(MAX_REQUEST_BYTES));
        Self(WebSocket::from_partially_read(stream, behind, Role::Server, Some(config)))
    }

    /// The text of the next request, if one comes in a moment.
    pub(super) fn receive(&mut self) -> Result<Option<String>, Disconnected> {
        match self.0.read() {
            Ok(Message::Text(text)) => Ok(Some(text.as_str().to_owned())),
            Err(Error::Io(error)) if error.kind() != ErrorKind::WouldBlock => Err(Disconnected),
            Ok(_) | Err(Error::Io(_)) => Ok(None),
            Err(_) => Err(Disconnected),
        }
    }

    /// Sends a text at once.
    pub(super) fn text(&mut self, text: &str) -> Result<(), Disconnected> {
        Ok(self.0.send(Message::text(text))?)
    }

    /// Writes bytes that go out with the next [`flush`](Self::flush).
    pub(super) fn write(&mut self, bytes: Vec<u8>) -> Result<(), Disconnected> {
        Ok(self.0.write(Message::Binary(bytes.into()))?)
    }

    /// Sends what is written.
    pub(super) fn flush(&mut self) -> Result<(), Disconnected> {
        Ok(self.0.flush()?)
    }

    /// Sends a close frame behind everything else. A client that answers the frame has read everything.
    pub(super) fn close(&mut self) -> Result<(), Disconnected> {
        let frame = CloseFrame { code: CloseCode::Away, reason: "the run is over".into() };
        self.0.close(Some(frame))?;
        loop {
            self.receive()?;
        }
    }
}
