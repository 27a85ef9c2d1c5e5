//! A Unix socket, polled without blocking.

use std::io::{ErrorKind, Read, Write};
use std::os::unix::net::UnixStream;

use anyhow::ensure;

use crate::exchange::Ends;

/// Bytes of a message; it begins with its number.
const BYTES: usize = 128;

pub(crate) fn ends(stream: UnixStream) -> anyhow::Result<Ends> {
    stream.set_nonblocking(true)?;
    let mut output = stream.try_clone()?;
    let mut input = stream;
    let mut message = [0; BYTES];
    Ok(Ends {
        send: Box::new(move |number| {
            message[..8].copy_from_slice(&number.to_ne_bytes());
            // At most one message is under way, so the socket always has room for it.
            ensure!(output.write(&message)? == BYTES, "the socket took only part of a message");
            Ok(())
        }),
        receive: Box::new(move || match input.read(&mut message) {
            Ok(BYTES) => Ok(message.first_chunk().map(|number| u64::from_ne_bytes(*number))),
            Ok(_) => anyhow::bail!("the other side has gone"),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(None),
            Err(error) => Err(error.into()),
        }),
    })
}
