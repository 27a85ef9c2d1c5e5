//! `masseter can serve`: the emulated drives on simulated buses, for third-party tools, over socketcand's
//! protocol.
//!
//! Every client is a node of its own on the bus it opens: what it sends takes part in arbitration, reaches
//! the drives and the other clients. There is no master here; the client is one, or listens. Who
//! reads too slowly loses frames first and then the connection, and disturbs nobody.

use std::io;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use masseter_plant::emulation::OpenLink;
use masseter_shared::clock;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::lifecycle::StopRequest;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::client::Client;

use masseter_terminal::{Exit, status};

/// Clients on one bus at a time.
const CLIENTS: usize = 8;
/// How far the buses may lag behind the clock.
const STEP: Timespec = Timespec { tv_sec: 0, tv_nsec: 500_000 };

/// What `can serve` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct ServeArgs {
    /// Scenario whose buses and drives are meant
    scenario: Option<PathBuf>,
    /// Address to listen on; whoever reaches it can move the drives
    #[arg(long, default_value = "127.0.0.1:29536")]
    listen: SocketAddr,
}

/// Serves until it is interrupted.
pub(crate) fn serve(args: &ServeArgs) -> anyhow::Result<Exit> {
    let scenario = masseter_plan::given(args.scenario.as_deref())?;
    let stop = StopRequest::listen_alone().context("cannot listen for signals")?;
    let listener = listen(args.listen)?;
    let mut link = OpenLink::new(&scenario, CLIENTS, clock::now_ns())?;
    announce(&listener, &scenario)?;
    let mut clients = Vec::new();
    while !stop.is_made() {
        wait(&listener, &clients).context("cannot wait for clients")?;
        let now_ns = clock::now_ns();
        link.advance(now_ns)?;
        accept(&listener, &mut clients, CLIENTS * link.buses());
        clients.retain_mut(|client| client.serve(&mut link, now_ns));
    }
    Ok(Exit::Passed)
}

fn listen(address: SocketAddr) -> anyhow::Result<TcpListener> {
    let listener = TcpListener::bind(address)
        .with_context(|| format!("cannot listen on {address}; choose another address with --listen"))?;
    listener.set_nonblocking(true).context("cannot serve without blocking")?;
    Ok(listener)
}

/// Says on standard error what is served where.
fn announce(listener: &TcpListener, scenario: &Scenario) -> anyhow::Result<()> {
    let address = listener.local_addr().context("the server has no address")?;
    for (bus, axes) in scenario.can.buses.iter().enumerate() {
        let node = |&axis: &usize| format!("{} (node {})", AXIS_NAMES[axis], scenario.can.node_ids[axis]);
        let nodes: Vec<String> = axes.iter().map(node).collect();
        status!("can{bus}: {}", nodes.join(", "));
    }
    status!("socketcand protocol on {address}; end with Ctrl-C");
    Ok(())
}

/// Waits for the next step, or until a client wants something.
fn wait(listener: &TcpListener, clients: &[Client]) -> io::Result<()> {
    let mut awaited = vec![PollFd::new(listener, PollFlags::IN)];
    awaited.extend(clients.iter().map(|client| PollFd::new(client.stream(), PollFlags::IN)));
    match poll(&mut awaited, Some(&STEP)) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Takes connections as long as there are places; the others are closed. One that cannot be taken concerns nobody else.
fn accept(listener: &TcpListener, clients: &mut Vec<Client>, places: usize) {
    while let Ok((stream, address)) = listener.accept() {
        if clients.len() == places {
            status!("no place is left for a client from {address}");
        } else {
            clients.extend(Client::greet(stream));
        }
    }
}
