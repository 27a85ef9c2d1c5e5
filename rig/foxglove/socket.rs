//! A client's connection, with a limit on the bytes read per poll.
//!
//! The WebSocket library reads for as long as bytes arrive, also when they never complete a message. The limit keeps a
//! client that sends without end from blocking the serving thread.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;

/// Most bytes read per poll.
const BYTES_PER_POLL: usize = 1 << 16;

/// A connection that never blocks.
#[derive(Debug)]
pub(super) struct Socket {
    stream: TcpStream,
    /// Bytes that may still be read in this poll.
    remaining: usize,
}

impl Socket {
    pub(super) fn new(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, remaining: BYTES_PER_POLL })
    }

    /// Restores the limit.
    pub(super) fn begin_poll(&mut self) {
        self.remaining = BYTES_PER_POLL;
    }
}

impl Read for Socket {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.remaining == 0 {
            return Err(ErrorKind::WouldBlock.into());
        }
        let most = bytes.len().min(self.remaining);
        let read = self.stream.read(&mut bytes[..most])?;
        self.remaining -= read;
        Ok(read)
    }
}

impl Write for Socket {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.stream.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}
