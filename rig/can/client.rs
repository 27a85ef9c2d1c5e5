//! One client of the socketcand server: its connection, and its node on a bus.
//!
//! The connection never blocks. Unsent text waits in a buffer of bounded size.

use std::fmt::Display;

use masseter_can::socketcand::{ECHO, OK, Request, RequestError, Requests, write_frame};
use masseter_can::{Bus, ReceiveError};
use masseter_plant::emulation::{NodePort, OpenLink};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::conversation::{Conversation, Left, Limits};
use masseter_scenario::wording::counted;

use masseter_recorder::StderrWriter;

/// Most bytes from a client that has opened no bus.
const MOST_BYTES: usize = 1 << 16;
/// Delay of frames after the answer to a change of mode: clients expect that answer in a packet of its own, ns.
const MODE_DELAY_NS: u64 = 20_000_000;

/// Time for a client to open a bus after its first request, so that silent connections keep no places, ns.
const OPEN_TIMEOUT_NS: u64 = 5 * SECOND_NS;

/// A connected client.
#[derive(Debug)]
pub(super) struct Client {
    conversation: Conversation,
    requests: Requests,
    /// The bus that it asked for, and its place there once it has one.
    bus: Option<usize>,
    node: Option<NodePort>,
    frames_from_ns: Option<u64>,
    heard_ns: u64,
}

/// Why a connection is closed.
#[derive(Debug, thiserror::Error)]
pub(super) enum CloseReason {
    #[error(transparent)]
    Left(#[from] Left),
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
}

impl Client {
    /// A client whose first request has come.
    pub(super) fn new(mut conversation: Conversation, now_ns: u64) -> Self {
        conversation.renew(Limits::answer(OPEN_TIMEOUT_NS, MOST_BYTES), now_ns);
        let requests = Requests::default();
        Self { conversation, requests, bus: None, node: None, frames_from_ns: None, heard_ns: now_ns }
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
    pub(super) fn conversation(&self) -> &Conversation {
        &self.conversation
    }

    /// Answers requests and sends received frames. Returns why the connection is closed, if it is.
    pub(super) fn serve(
        &mut self,
        link: &mut OpenLink,
        now_ns: u64,
        stderr: &StderrWriter,
    ) -> Result<(), CloseReason> {
        self.conversation.hear();
        self.connect(link, now_ns);
        // A client that waits for its place can send only what its connection has room for.
        if self.awaited().is_none() {
            let bytes = self.conversation.consume(self.conversation.heard().len());
            self.heard_ns = if bytes.is_empty() { self.heard_ns } else { now_ns };
            self.requests.push(&bytes);
        }
        self.answer(link, now_ns)?;
        self.queue_frames(link, now_ns, stderr);
        match self.conversation.left(now_ns) {
            None => Ok(()),
            Some(Left::Late(_)) => Err(CloseReason::Silent),
            Some(left) => Err(left.into()),
        }
    }

    /// Says why, and frees its place.
    pub(super) fn close(mut self, reason: &CloseReason, link: &mut OpenLink) {
        // The client may have closed its end already.
        self.refuse(reason);
        if let Some(node) = self.node.take() {
            link.disconnect(node);
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
            Request::Open(name) => self.open(&name, link, now_ns)?,
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

    fn open(&mut self, name: &str, link: &mut OpenLink, now_ns: u64) -> Result<(), CloseReason> {
        if self.node.is_some() {
            return Err(CloseReason::OpenTwice);
        }
        let buses = link.buses();
        self.bus = name.strip_prefix("can").and_then(|bus| bus.parse().ok()).filter(|bus| *bus < buses);
        if self.bus.is_none() {
            return Err(CloseReason::NoBus { name: name.to_owned(), buses });
        }
        self.connect(link, now_ns);
        Ok(())
    }

    /// Takes a place on the bus for which it waits, if there is one.
    fn connect(&mut self, link: &mut OpenLink, now_ns: u64) {
        let Some(bus) = self.awaited() else { return };
        self.node = link.connect(bus);
        if self.is_open() {
            self.conversation.renew(Limits::admitted(usize::MAX), now_ns);
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
        self.conversation.say(text.as_bytes());
    }
}
