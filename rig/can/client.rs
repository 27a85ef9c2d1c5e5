//! One client of the socketcand server: its connection, and its node on a bus.
//!
//! It blocks nobody: what cannot be written now is kept, up to a bound.

use masseter_terminal::status;
use std::fmt::Display;
use std::io::{self, Read, Write};
use std::net::TcpStream;

use masseter_can::socketcand::{ECHO, GREETING, OK, Request, RequestError, Requests, write_frame};
use masseter_can::{Bus, ReceiveError};
use masseter_plant::emulation::{NodePort, OpenLink};

/// Text that waits for a client to read it; a bus at full load makes about 0.5 MB a second.
const BACKLOG: usize = 1 << 20;
/// Frames are held back so long after the mode was granted: clients read the answer as a packet of its own.
const SETTLING_NS: u64 = 20_000_000;

/// A connected client.
#[derive(Debug)]
pub(super) struct Client {
    stream: TcpStream,
    requests: Requests,
    unsent: Vec<u8>,
    node: Option<NodePort>,
    frames_from_ns: Option<u64>,
}

/// Why a connection ends.
#[derive(Debug, thiserror::Error)]
enum Farewell {
    #[error("closed")]
    Closed,
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Request(#[from] RequestError),
    #[error("no bus `{name}`, or no place left on it; there are {buses} buses, from can0 on")]
    NoPlace { name: String, buses: usize },
    #[error("one bus a connection: open another connection for another bus")]
    OpenTwice,
    #[error("{0} bytes wait to be read")]
    TooSlow(usize),
}

impl Client {
    /// Takes a connection.
    pub(super) fn greet(stream: TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let unsent = GREETING.as_bytes().to_vec();
        Ok(Self { stream, requests: Requests::default(), unsent, node: None, frames_from_ns: None })
    }

    /// The connection, to wait for.
    pub(super) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Does what it asks and hands it what it received; whether it stays.
    pub(super) fn serve(&mut self, link: &mut OpenLink, now_ns: u64) -> bool {
        let served = self.read_requests().and_then(|()| {
            self.answer(link, now_ns)?;
            self.collect(link, now_ns);
            self.write_unsent()
        });
        let Err(reason) = served else { return true };
        if !matches!(reason, Farewell::Closed) {
            status!("a client is disconnected: {reason}");
            // It may be gone already.
            self.refuse(&reason);
            let _ = self.write_unsent();
        }
        if let Some(node) = self.node.take() {
            link.disconnect(node);
        }
        false
    }

    fn read_requests(&mut self) -> Result<(), Farewell> {
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(Farewell::Closed),
            Ok(count) => {
                self.requests.push(&bytes[..count]);
                Ok(())
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn answer(&mut self, link: &mut OpenLink, now_ns: u64) -> Result<(), Farewell> {
        while let Some(request) = self.requests.take() {
            match request {
                Ok(request) => self.obey(request, link, now_ns)?,
                Err(stray @ RequestError::Stray) => return Err(stray.into()),
                Err(error) => self.refuse(error),
            }
        }
        Ok(())
    }

    fn obey(&mut self, request: Request, link: &mut OpenLink, now_ns: u64) -> Result<(), Farewell> {
        match request {
            Request::Open(name) => {
                self.open(&name, link)?;
                self.say(OK);
            }
            Request::RawMode => {
                self.frames_from_ns = Some(now_ns + SETTLING_NS);
                self.say(OK);
            }
            Request::Echo => self.say(ECHO),
            Request::Send(frame) => {
                let Some(node) = &self.node else {
                    self.refuse("open a bus first");
                    return Ok(());
                };
                // A full queue loses the frame, as a controller's does; the client misses its answer.
                let _ = link.port(node).send(now_ns, frame);
            }
        }
        Ok(())
    }

    /// Says why a request is not served; the next one may be.
    fn refuse(&mut self, reason: impl Display) {
        self.say(&format!("< error {reason} >"));
    }

    fn open(&mut self, name: &str, link: &mut OpenLink) -> Result<(), Farewell> {
        if self.node.is_some() {
            return Err(Farewell::OpenTwice);
        }
        let bus = name.strip_prefix("can").and_then(|bus| bus.parse().ok());
        self.node = bus.and_then(|bus| link.connect(bus));
        match self.node {
            Some(_) => Ok(()),
            None => Err(Farewell::NoPlace { name: name.to_owned(), buses: link.buses() }),
        }
    }

    /// Takes what its node has received.
    fn collect(&mut self, link: &mut OpenLink, now_ns: u64) {
        let (Some(node), Some(from_ns)) = (&self.node, self.frames_from_ns) else { return };
        if now_ns < from_ns {
            return;
        }
        let mut text = String::new();
        loop {
            match link.port(node).receive(now_ns) {
                Ok(Some(received)) => {
                    write_frame(&mut text, &received).expect("writing to a string does not fail");
                }
                Err(ReceiveError::Overrun { lost }) => status!("{lost} frames were lost to a client"),
                Ok(None) | Err(_) => break,
            }
        }
        self.say(&text);
    }

    fn say(&mut self, text: &str) {
        self.unsent.extend_from_slice(text.as_bytes());
    }

    fn write_unsent(&mut self) -> Result<(), Farewell> {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => return Err(error.into()),
            }
        }
        match self.unsent.len() {
            waiting if waiting > BACKLOG => Err(Farewell::TooSlow(waiting)),
            _ => Ok(()),
        }
    }
}
