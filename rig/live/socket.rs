//! A client's connection. It never blocks, and gives only so much a turn: the library reads on for as long as there
//! is something to read, also where that never becomes a message.

use std::io::{self, ErrorKind, Read, Write};
use std::net::TcpStream;

/// What is read of a client in one turn, bytes.
const READ_IN_A_TURN: usize = 1 << 16;

/// A client's connection.
#[derive(Debug)]
pub(super) struct Socket {
    stream: TcpStream,
    /// What may still be read in this turn, bytes.
    left: usize,
}

impl Socket {
    pub(super) fn of(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        Ok(Self { stream, left: READ_IN_A_TURN })
    }

    /// As much may be read again.
    pub(super) fn begin_turn(&mut self) {
        self.left = READ_IN_A_TURN;
    }
}

impl Read for Socket {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        if self.left == 0 {
            return Err(ErrorKind::WouldBlock.into());
        }
        let most = bytes.len().min(self.left);
        let read = self.stream.read(&mut bytes[..most])?;
        self.left -= read;
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
