//! `masseter can serve`: the emulated drives on simulated buses, for other tools, over socketcand's protocol.
//!
//! Every client is a node on the bus that it opens: its frames take part in arbitration and reach the drives and the
//! other clients. No master runs here; a client can be one. A client that reads too slowly first loses frames, then the
//! connection, and delays no other. On a full bus a new client takes the place of the client whose last request is
//! the oldest. So idle clients lock nobody out. A client that only listens keeps its place until a new client needs it.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use masseter_can::socketcand::GREETING;
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::emulation::OpenLink;
use masseter_runtime::clock;
use masseter_runtime::conversation::{Left, Limits, Look, Newcomers};
use masseter_runtime::lifecycle::StopRequest;
use masseter_scenario::Scenario;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::client::{Client, CloseReason};
use crate::arguments::parse_address;
use masseter_recorder::Refusals;
use masseter_recorder::StderrWriter;
use masseter_terminal::Exit;

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

/// The arguments of `can serve`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter can serve\n  python3 -c 'import can; can.Bus(interface=\"socketcand\", host=\"127.0.0.1\", port=29536, channel=\"can0\")'"
)]
pub(crate) struct ServeArgs {
    /// Scenario file with buses and drives [default: the published rig]
    scenario: Option<PathBuf>,
    /// Port of this machine, or address, to listen on; every client that reaches it can move the emulated drives
    #[arg(long, value_name = "PORT|ADDR:PORT", default_value = "127.0.0.1:29536", value_parser = parse_address)]
    listen: SocketAddr,
}

/// Serves until Ctrl-C.
pub(crate) fn serve(args: &ServeArgs) -> anyhow::Result<Exit> {
    let scenario = masseter_plan::read_scenario(args.scenario.as_deref())?;
    let stop = StopRequest::listen_alone().context("cannot listen for signals")?;
    let listener = listen(args.listen)?;
    let mut link = OpenLink::new(&scenario, CLIENTS, clock::now_ns())?;
    let stderr = StderrWriter::start();
    announce(&listener, &scenario, &stderr)?;
    let newcomers = Newcomers::at(listener.into(), NEWCOMERS, Limits::newcomer(LONGEST_FIRST));
    let mut newcomers = newcomers.context("cannot serve without blocking")?.greeted_with(GREETING.as_bytes());
    let mut clients = Vec::new();
    let mut refusals =
        Refusals::new("a client is disconnected".to_owned(), "clients are disconnected".to_owned());
    let mut accept_from_ns = 0;
    while !stop.is_made() {
        wait(&clients).context("cannot wait for clients")?;
        let now_ns = clock::now_ns();
        link.advance(now_ns)?;
        link.save_memory()?;
        if now_ns >= accept_from_ns {
            accept_from_ns = now_ns + ACCEPT_INTERVAL_NS;
            let Look { asking, out } = newcomers.look(now_ns, |bytes| bytes.contains(&b'>'));
            clients.extend(asking.into_iter().map(|conversation| Client::new(conversation, now_ns)));
            for left in out {
                count(&left.into(), &mut refusals);
            }
        }
        serve_clients(&mut clients, &mut link, now_ns, &stderr, &mut refusals);
        make_room(&mut clients, &mut link, &mut refusals);
        if let Some(line) = refusals.line(now_ns) {
            stderr.write(&format!("{line}\n"));
        }
    }
    stderr.finish();
    Ok(Exit::Passed)
}

fn listen(address: SocketAddr) -> anyhow::Result<TcpListener> {
    TcpListener::bind(address)
        .with_context(|| format!("cannot listen on {address}; choose another address with --listen"))
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

/// Waits for the next step, or a request.
fn wait(clients: &[Client]) -> io::Result<()> {
    let of_client = |client| PollFd::new(Client::conversation(client), PollFlags::IN);
    let mut events: Vec<_> = clients.iter().map(of_client).collect();
    match poll(&mut events, Some(&STEP)) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Serves every client, and disconnects those that have left or broken the rules.
fn serve_clients(
    clients: &mut Vec<Client>,
    link: &mut OpenLink,
    now_ns: u64,
    stderr: &StderrWriter,
    refusals: &mut Refusals,
) {
    for at in (0..clients.len()).rev() {
        if let Err(reason) = clients[at].serve(link, now_ns, stderr) {
            disconnect(clients.remove(at), &reason, link, refusals);
        }
    }
}

fn disconnect(client: Client, reason: &CloseReason, link: &mut OpenLink, refusals: &mut Refusals) {
    client.close(reason, link);
    count(reason, refusals);
}

/// A client that leaves by itself is not worth a word.
fn count(reason: &CloseReason, refusals: &mut Refusals) {
    if !matches!(reason, CloseReason::Left(Left::Closed)) {
        refusals.count(reason.to_string());
    }
}

/// Disconnects, for each client that waits for a place on a bus, the one there that has asked for nothing for longest, and
/// the oldest of too many newcomers.
fn make_room(clients: &mut Vec<Client>, link: &mut OpenLink, refusals: &mut Refusals) {
    let awaited: Vec<_> = clients.iter().filter_map(Client::awaited).collect();
    for bus in awaited {
        let of_bus = (0..clients.len()).filter(|&at| clients[at].is_on(bus));
        if let Some(idle) = of_bus.min_by_key(|&at| clients[at].heard_ns()) {
            disconnect(clients.remove(idle), &CloseReason::Idle, link, refusals);
        }
    }
    if clients.iter().filter(|client| !client.is_open()).count() > NEWCOMERS
        && let Some(oldest) = clients.iter().position(|client| !client.is_open())
    {
        disconnect(clients.remove(oldest), &CloseReason::Crowded, link, refusals);
    }
}
