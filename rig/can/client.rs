//! One client of the socketcand server: its connection, and its node on a bus.
//!
//! The connection never blocks. Unsent text waits in a buffer of bounded size.

use std::fmt::Display;
use std::io::{self, Read, Write};
use std::net::TcpStream;

use masseter_can::socketcand::{ECHO, GREETING, OK, Request, RequestError, Requests, write_frame};
use masseter_can::{Bus, ReceiveError};
use masseter_plant::emulation::{NodePort, OpenLink};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::wording::counted;

use crate::stderr_writer::StderrWriter;

/// Most unsent bytes of a client; a bus at full load makes about 0.5 MB a second.
const MAX_UNSENT: usize = 1 << 20;
/// Delay of frames after the answer to a change of mode: clients expect that answer in a packet of its own, ns.
const MODE_DELAY_NS: u64 = 20_000_000;

/// Time for a new client to open a bus, so that silent connections keep no places, ns.
const OPEN_TIMEOUT_NS: u64 = 5 * SECOND_NS;

/// A connected client.
#[derive(Debug)]
pub(super) struct Client {
    stream: TcpStream,
    requests: Requests,
    unsent: Vec<u8>,
    /// The bus that it asked for, and its place there once it has one.
    bus: Option<usize>,
    node: Option<NodePort>,
    frames_from_ns: Option<u64>,
    open_by_ns: u64,
    heard_ns: u64,
}

/// Why a connection is closed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CloseReason {
    #[error("closed")]
    Closed,
    #[error(transparent)]
    Io(#[from] io::Error),
    #[error(transparent)]
    Request(#[from] RequestError),
    #[error("no bus '{name}'; the buses are can0 to can{}", .buses - 1)]
    NoBus { name: String, buses: usize },
    #[error("another client takes its place, since it has asked for nothing for longest")]
    Idle,
    #[error("others take its place, since it has opened no bus yet")]
    Crowded,
    #[error("it opened no bus within {} s", OPEN_TIMEOUT_NS / SECOND_NS)]
    Silent,
    #[error("a connection opens one bus: use another connection for another bus")]
    OpenTwice,
    #[error("it reads too slowly: {0} bytes are unread")]
    TooSlow(usize),
}

impl Client {
    /// Greets a new client.
    pub(super) fn accept(stream: TcpStream, now_ns: u64) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let unsent = GREETING.as_bytes().to_vec();
        let open_by_ns = now_ns + OPEN_TIMEOUT_NS;
        let requests = Requests::default();
        let heard_ns = now_ns;
        Ok(Self {
            stream,
            requests,
            unsent,
            bus: None,
            node: None,
            frames_from_ns: None,
            open_by_ns,
            heard_ns,
        })
    }

    /// When its last request came, ns.
    pub(super) fn heard_ns(&self) -> u64 {
        self.heard_ns
    }

    /// The bus on which it waits for a place.
    pub(super) fn awaited(&self) -> Option<usize> {
        self.bus.filter(|_| !self.is_open())
    }

    pub(super) fn is_open(&self) -> bool {
        self.node.is_some()
    }

    /// Whether it has a place on this bus.
    pub(super) fn is_on(&self, bus: usize) -> bool {
        self.is_open() && self.bus == Some(bus)
    }

    /// The connection, for polling.
    pub(super) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    /// Answers requests and sends received frames; false once the connection is closed.
    pub(super) fn serve(&mut self, link: &mut OpenLink, now_ns: u64, stderr: &StderrWriter) -> bool {
        let served = self.read_requests(now_ns).and_then(|()| {
            self.connect(link);
            self.answer(link, now_ns)?;
            self.queue_frames(link, now_ns, stderr);
            self.check_open(now_ns)?;
            self.write_unsent()
        });
        let Err(reason) = served else { return true };
        self.close(&reason, link, stderr);
        false
    }

    /// Says why, and frees its place.
    pub(super) fn close(&mut self, reason: &CloseReason, link: &mut OpenLink, stderr: &StderrWriter) {
        if !matches!(reason, CloseReason::Closed) {
            stderr.write(&format!("a client is disconnected: {reason}\n"));
            // The client may have closed its end already.
            self.refuse(reason);
            let _ = self.write_unsent();
        }
        if let Some(node) = self.node.take() {
            link.disconnect(node);
        }
    }

    fn check_open(&self, now_ns: u64) -> Result<(), CloseReason> {
        if self.node.is_none() && now_ns > self.open_by_ns { Err(CloseReason::Silent) } else { Ok(()) }
    }

    fn read_requests(&mut self, now_ns: u64) -> Result<(), CloseReason> {
        let mut bytes = [0; 4096];
        match self.stream.read(&mut bytes) {
            Ok(0) => Err(CloseReason::Closed),
            Ok(count) => {
                self.heard_ns = now_ns;
                self.requests.push(&bytes[..count]);
                Ok(())
            }
            Err(error) if error.kind() == io::ErrorKind::WouldBlock => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    fn answer(&mut self, link: &mut OpenLink, now_ns: u64) -> Result<(), CloseReason> {
        while self.awaited().is_none()
            && let Some(request) = self.requests.take()
        {
            match request {
                Ok(request) => self.handle(request, link, now_ns)?,
                Err(stray @ RequestError::Stray) => return Err(stray.into()),
                Err(error) => self.refuse(error),
            }
        }
        Ok(())
    }

    fn handle(&mut self, request: Request, link: &mut OpenLink, now_ns: u64) -> Result<(), CloseReason> {
        match request {
            Request::Open(name) => self.open(&name, link)?,
            Request::RawMode => {
                self.frames_from_ns = Some(now_ns + MODE_DELAY_NS);
                self.queue(OK);
            }
            Request::Echo => self.queue(ECHO),
            Request::Send(frame) => {
                let Some(node) = &self.node else {
                    self.refuse("open a bus first");
                    return Ok(());
                };
                // A full queue drops the frame, as that of a CAN controller does.
                let _ = link.port(node).send(now_ns, frame);
            }
        }
        Ok(())
    }

    /// Answers a request with an error.
    fn refuse(&mut self, reason: impl Display) {
        self.queue(&format!("< error {reason} >"));
    }

    fn open(&mut self, name: &str, link: &mut OpenLink) -> Result<(), CloseReason> {
        if self.node.is_some() {
            return Err(CloseReason::OpenTwice);
        }
        let buses = link.buses();
        self.bus = name.strip_prefix("can").and_then(|bus| bus.parse().ok()).filter(|bus| *bus < buses);
        if self.bus.is_none() {
            return Err(CloseReason::NoBus { name: name.to_owned(), buses });
        }
        self.connect(link);
        Ok(())
    }

    /// Takes a place on the bus for which it waits, if there is one.
    fn connect(&mut self, link: &mut OpenLink) {
        let Some(bus) = self.awaited() else { return };
        self.node = link.connect(bus);
        if self.is_open() {
            self.queue(OK);
        }
    }

    /// Queues the frames that the node has received.
    fn queue_frames(&mut self, link: &mut OpenLink, now_ns: u64, stderr: &StderrWriter) {
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
                Err(ReceiveError::Overrun { lost }) => {
                    stderr.write(&format!("a client lost {}\n", counted(lost, "frame")));
                }
                Ok(None) | Err(_) => break,
            }
        }
        self.queue(&text);
    }

    fn queue(&mut self, text: &str) {
        self.unsent.extend_from_slice(text.as_bytes());
    }

    fn write_unsent(&mut self) -> Result<(), CloseReason> {
        while !self.unsent.is_empty() {
            match self.stream.write(&self.unsent) {
                Ok(count) => drop(self.unsent.drain(..count)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => return Err(error.into()),
            }
        }
        match self.unsent.len() {
            waiting if waiting > MAX_UNSENT => Err(CloseReason::TooSlow(waiting)),
            _ => Ok(()),
        }
    }
}
