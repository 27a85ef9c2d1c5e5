//! The line from a process to its supervisor, and the supervisor's request to end.

use std::io::{self, BufRead, BufReader, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::{os::unix::net::UnixStream, thread};

use rustix::io::Errno;
use rustix::net::{SendFlags, send};
use rustix::process::{Signal, set_parent_process_death_signal};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::report::{End, Order, Report};
use crate::conversation::line;

/// The process's end of the line.
#[derive(Debug, Clone)]
pub(crate) enum SupervisorLink {
    /// Standard input and output of a process of the supervisor's own executable.
    Pipes,
    /// The socket of an attached program. Its standard input and output belong to the user.
    Socket(Arc<Socket>),
}

/// An attached program's end of the socket.
#[derive(Debug)]
pub(crate) struct Socket {
    stream: UnixStream,
    /// The orders that a process waits for.
    orders: Mutex<Receiver<Order>>,
}

impl SupervisorLink {
    /// The line over a connected socket, and the request to end: an order, or the end of the supervisor.
    pub(super) fn over(stream: UnixStream) -> io::Result<(Self, StopRequest)> {
        let input = BufReader::new(stream.try_clone()?);
        let (sender, orders) = channel();
        let stop = StopRequest::default();
        let to_request = stop.clone();
        thread::Builder::new().name("supervisor".to_owned()).spawn(move || {
            for line in input.lines().map_while(Result::ok) {
                let is_taken = match serde_json::from_str(&line) {
                    Ok(Order::Stop) | Err(_) => false,
                    Ok(order) => sender.send(order).is_ok(),
                };
                if !is_taken {
                    break;
                }
            }
            to_request.make();
        })?;
        Ok((Self::Socket(Arc::new(Socket { stream, orders: Mutex::new(orders) })), stop))
    }

    /// Reports to the supervisor.
    pub(crate) fn report(&self, report: &Report) -> io::Result<()> {
        let line = line(report);
        match self {
            Self::Pipes => io::stdout().write_all(line.as_bytes()),
            Self::Socket(socket) => send_all(&socket.stream, line.as_bytes()),
        }
    }

    /// Waits for the next order: the start or a refusal, later the report that a fault has struck. None at the end of
    /// the supervisor.
    pub(crate) fn next_order(&self) -> io::Result<Option<Order>> {
        match self {
            Self::Pipes => {
                let mut line = String::new();
                io::stdin().read_line(&mut line)?;
                Ok(serde_json::from_str(&line).ok())
            }
            Self::Socket(socket) => Ok(socket.orders.lock().ok().and_then(|orders| orders.recv().ok())),
        }
    }

    /// Reports the end of an attached program's work. The rig's own processes report their end by an exit code.
    pub(crate) fn end(&self, end: End) -> io::Result<()> {
        match self {
            Self::Pipes => Ok(()),
            Self::Socket(_) => self.report(&Report::Ended(end)),
        }
    }
}

/// Sends without SIGPIPE, which ends a program that is not written in Rust.
fn send_all(stream: &UnixStream, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match send(stream, bytes, SendFlags::NOSIGNAL) {
            Ok(sent) => bytes = &bytes[sent..],
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// A request to end.
#[derive(Debug, Clone, Default)]
pub struct StopRequest(Arc<AtomicBool>);

impl StopRequest {
    /// Listens for SIGTERM, which the kernel also sends on the supervisor's death. A terminal sends SIGINT and SIGHUP
    /// to the whole process group: the supervisor reacts, and this process ignores both.
    pub(super) fn listen() -> io::Result<Self> {
        Self::by(&[SIGINT, SIGHUP])?;
        let requested = Self::by(&[SIGTERM])?;
        set_parent_process_death_signal(Some(Signal::TERM))?;
        Ok(requested)
    }

    /// Listens for SIGTERM and SIGINT, in a process without a supervisor.
    pub fn listen_alone() -> io::Result<Self> {
        Self::by(&[SIGTERM, SIGINT, SIGHUP])
    }

    fn by(signals: &[i32]) -> io::Result<Self> {
        let requested = Self::default();
        for &signal in signals {
            signal_hook::flag::register(signal, Arc::clone(&requested.0))?;
        }
        Ok(requested)
    }

    fn make(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end has been requested.
    pub fn is_made(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
