//! `masseter can serve`: the emulated drives on simulated buses, for other tools, over socketcand's protocol.
//!
//! Every client is a node on the bus that it opens: its frames take part in arbitration and reach the drives and the
//! other clients. No master runs here; a client can be one. A client that reads too slowly first loses frames, then the
//! connection, and delays no other. On a full bus a new client takes the place of the client whose last request is
//! the oldest. So idle clients exclude no others. A client that only listens keeps its place until a new client needs it.
//! No connection blocks: unsent text waits in a buffer of bounded size.

use std::net::{SocketAddr, TcpListener};
use std::{fmt::Display, io};

use masseter_can::socketcand::{ECHO, GREETING, OK, Request, RequestError, Requests, write_frame};
use masseter_can::{Bus, ReceiveError};
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::emulation::{NodePort, OpenLink};
use masseter_runtime::clock::SECOND_NS;
use masseter_runtime::conversation::{Conversation, Left, Limits, Look, Newcomers};
use masseter_terminal::{Refusals, StderrWriter};
use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::cli::arguments::parse_address;
use crate::prelude::*;

/// Clients on one bus at a time.
const CLIENTS: usize = 8;
/// Clients without a request, and clients that have opened no bus yet.
const NEWCOMERS: usize = 32;
/// Bytes until the end of a client's first request.
const LONGEST_FIRST: usize = 256;
/// Least time between two looks for new clients, which bounds what they cost, ns.
const ACCEPT_INTERVAL_NS: u64 = 2_000_000;
/// Longest wait between two steps of the buses.
const STEP: Timespec = Timespec { tv_sec: 0, tv_nsec: 500_000 };
/// Most bytes from a client that has opened no bus.
const MOST_BYTES: usize = 1 << 16;
/// Delay of frames after the answer to a change of mode: clients expect that answer in a packet of its own, ns.
const MODE_DELAY_NS: u64 = 20_000_000;
/// Time for a client to open a bus after its first request, so that silent connections keep no places, ns.
const OPEN_TIMEOUT_NS: u64 = 5 * SECOND_NS;

/// The arguments of `can serve`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  masseter can serve
  python3 -c 'import can; \
can.Bus(interface=\"socketcand\", host=\"127.0.0.1\", port=29536, channel=\"can0\")'")]
pub(crate) struct ServeArgs {
    /// Scenario file with buses and drives [default: the built-in scenario]
    scenario: Option<PathBuf>,
    /// Port of this machine, or address, to listen on; every client that reaches it can move the emulated drives
    #[arg(long, value_name = "PORT|ADDR:PORT", default_value = "127.0.0.1:29536", value_parser = parse_address)]
    listen: SocketAddr,
}

/// Serves until Ctrl-C.
pub(crate) fn serve(args: &ServeArgs) -> anyhow::Result<Exit> {
    let scenario = masseter_plan::read_scenario(args.scenario.as_deref())?;
    let stop =
        masseter_runtime::lifecycle::StopRequest::listen_alone().context("cannot listen for signals")?;
    let listener = TcpListener::bind(args.listen)
        .with_context(|| format!("cannot listen on {}; choose another address with --listen", args.listen))?;
    let mut server = Server {
        link: OpenLink::new(&scenario, CLIENTS, clock::now_ns())?,
        stderr: StderrWriter::start(),
        refusals: Refusals::new("a client is disconnected".to_owned(), "clients are disconnected".to_owned()),
        clients: Vec::new(),
    };
    announce(&listener, &scenario, &server.stderr)?;
    let newcomers = Newcomers::at(listener.into(), NEWCOMERS, Limits::newcomer(LONGEST_FIRST));
    let mut newcomers = newcomers.context("cannot serve without blocking")?.greeted_with(GREETING.as_bytes());
    let mut accept_from_ns = 0;
    while !stop.is_made() {
        server.wait().context("cannot wait for clients")?;
        let now_ns = clock::now_ns();
        server.link.advance(now_ns)?;
        server.link.save_memory()?;
        if now_ns >= accept_from_ns {
            accept_from_ns = now_ns + ACCEPT_INTERVAL_NS;
            server.admit(newcomers.look(now_ns, |bytes| bytes.contains(&b'>')), now_ns);
        }
        server.serve_clients(now_ns);
        server.make_room();
        if let Some(line) = server.refusals.line(now_ns) {
            server.stderr.write(&format!("{line}\n"));
        }
    }
    server.stderr.finish();
    Ok(Exit::Passed)
}

/// Lists buses, drives and the address on standard error.
fn announce(listener: &TcpListener, scenario: &Scenario, stderr: &StderrWriter) -> anyhow::Result<()> {
    let address = listener.local_addr().context("the server has no address")?;
    for (bus, axes) in scenario.can.buses.iter().enumerate() {
        let node = |&axis: &usize| format!("{} (node {})", AXIS_NAMES[axis], scenario.can.node_ids[axis]);
        let nodes: Vec<String> = axes.iter().map(node).collect();
        stderr.write(&format!("can{bus}: {}\n", nodes.join(", ")));
    }
    stderr.write(&format!("socketcand protocol on {address}; stop with Ctrl-C\n"));
    Ok(())
}

/// The simulated buses and everybody who is connected.
struct Server {
    link: OpenLink,
    stderr: StderrWriter,
    refusals: Refusals,
    clients: Vec<Client>,
}

impl Server {
    /// Waits for the next step, or a request.
    fn wait(&self) -> io::Result<()> {
        let clients = self.clients.iter();
        let mut events: Vec<_> =
            clients.map(|client| PollFd::new(&client.conversation, PollFlags::IN)).collect();
        match poll(&mut events, Some(&STEP)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => Ok(()),
            Err(error) => Err(error.into()),
        }
    }

    /// Takes in the newcomers that have sent a request.
    fn admit(&mut self, Look { asking, out }: Look, now_ns: u64) {
        self.clients.extend(asking.into_iter().map(|conversation| Client::new(conversation, now_ns)));
        for left in out {
            self.count_refusal(&left.into());
        }
    }

    /// Serves every client, and disconnects those that have left or broken the rules.
    fn serve_clients(&mut self, now_ns: u64) {
        for place in (0..self.clients.len()).rev() {
            if let Err(reason) = self.clients[place].serve(&mut self.link, now_ns, &self.stderr) {
                self.disconnect(place, &reason);
            }
        }
    }

    /// For each client that waits for a place on a bus, disconnects the client there whose last request is the
    /// oldest. Of too many newcomers, disconnects the oldest.
    fn make_room(&mut self) {
        let awaited: Vec<_> = self.clients.iter().filter_map(Client::awaited).collect();
        for bus in awaited {
            let is_on_bus = |client: &Client| client.node.is_some() && client.bus == Some(bus);
            let on_bus = (0..self.clients.len()).filter(|&place| is_on_bus(&self.clients[place]));
            if let Some(idle) = on_bus.min_by_key(|&place| self.clients[place].heard_ns) {
                self.disconnect(idle, &CloseReason::Idle);
            }
        }
        let mut without_bus = (0..self.clients.len()).filter(|&place| self.clients[place].node.is_none());
        if let Some(oldest) = without_bus.next()
            && without_bus.count() >= NEWCOMERS
        {
            self.disconnect(oldest, &CloseReason::Crowded);
        }
    }

    fn disconnect(&mut self, place: usize, reason: &CloseReason) {
        self.clients.remove(place).close(reason, &mut self.link);
        self.count_refusal(reason);
    }

    /// A client that leaves by itself is not worth a word.
    fn count_refusal(&mut self, reason: &CloseReason) {
        if !matches!(reason, CloseReason::Left(Left::Closed)) {
            self.refusals.count(reason.to_string());
        }
    }
}

/// A connected client.
#[derive(Debug)]
struct Client {
    conversation: Conversation,
    requests: Requests,
    /// The bus that it asked for, and its place there once it has one.
    bus: Option<usize>,
    node: Option<NodePort>,
    frames_from_ns: Option<u64>,
    /// When its last request came, ns.
    heard_ns: u64,
}

/// Why a connection is closed.
#[derive(Debug, thiserror::Error)]
enum CloseReason {
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
    fn new(mut conversation: Conversation, now_ns: u64) -> Self {
        conversation.renew(Limits::answer(OPEN_TIMEOUT_NS, MOST_BYTES), now_ns);
        let requests = Requests::default();
        Self { conversation, requests, bus: None, node: None, frames_from_ns: None, heard_ns: now_ns }
    }

    /// The bus on which it waits for a place.
    fn awaited(&self) -> Option<usize> {
        self.bus.filter(|_| self.node.is_none())
    }

    /// Answers requests and sends received frames. Returns why the connection is closed, if it is.
    fn serve(&mut self, link: &mut OpenLink, now_ns: u64, stderr: &StderrWriter) -> Result<(), CloseReason> {
        self.conversation.hear();
        self.connect(link, now_ns);
        // A client that waits for its place can send only what its connection has room for.
        if self.awaited().is_none() {
            let bytes = self.conversation.consume(self.conversation.heard().len());
            self.heard_ns = if bytes.is_empty() { self.heard_ns } else { now_ns };
            self.requests.push(&bytes);
        }
        self.answer_requests(link, now_ns)?;
        self.queue_frames(link, now_ns, stderr);
        match self.conversation.left(now_ns) {
            None => Ok(()),
            Some(Left::Late(_)) => Err(CloseReason::Silent),
            Some(left) => Err(left.into()),
        }
    }

    /// Says why, and frees its place.
    fn close(mut self, reason: &CloseReason, link: &mut OpenLink) {
        // The client may have closed its end already.
        self.refuse(reason);
        if let Some(node) = self.node.take() {
            link.disconnect(node);
        }
    }

    fn answer_requests(&mut self, link: &mut OpenLink, now_ns: u64) -> Result<(), CloseReason> {
        while self.awaited().is_none()
            && let Some(request) = self.requests.take()
        {
            match request {
                Ok(request) => self.answer_request(request, link, now_ns)?,
                Err(stray @ RequestError::Stray) => return Err(stray.into()),
                Err(error) => self.refuse(error),
            }
        }
        Ok(())
    }

    fn answer_request(
        &mut self,
        request: Request,
        link: &mut OpenLink,
        now_ns: u64,
    ) -> Result<(), CloseReason> {
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
        if self.node.is_some() {
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
