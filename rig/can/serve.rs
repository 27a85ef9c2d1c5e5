//! `masseter can serve`: the emulated drives on simulated buses, for other tools, over socketcand's protocol.
//!
//! Every client is a node on the bus that it opens: its frames take part in arbitration and reach the drives and the
//! other clients. No master runs here; a client can be one. A client that reads too slowly first loses frames, then the
//! connection, and delays no other.

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

use crate::stderr_writer::StderrWriter;
use masseter_terminal::Exit;

/// Clients on one bus at a time.
const CLIENTS: usize = 8;
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
    /// Address to listen on; every client that reaches it can move the emulated drives
    #[arg(long, default_value = "127.0.0.1:29536")]
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
    let mut clients = Vec::new();
    while !stop.is_made() {
        wait(&listener, &clients).context("cannot wait for clients")?;
        let now_ns = clock::now_ns();
        link.advance(now_ns)?;
        accept(&listener, &mut clients, CLIENTS * link.buses(), &stderr);
        clients.retain_mut(|client| client.serve(&mut link, now_ns, &stderr));
    }
    stderr.finish();
    Ok(Exit::Passed)
}

fn listen(address: SocketAddr) -> anyhow::Result<TcpListener> {
    let listener = TcpListener::bind(address)
        .with_context(|| format!("cannot listen on {address}; choose another address with --listen"))?;
    listener.set_nonblocking(true).context("cannot serve without blocking")?;
    Ok(listener)
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

/// Waits for the next step, a new client, or a request.
fn wait(listener: &TcpListener, clients: &[Client]) -> io::Result<()> {
    let mut events = vec![PollFd::new(listener, PollFlags::IN)];
    events.extend(clients.iter().map(|client| PollFd::new(client.stream(), PollFlags::IN)));
    match poll(&mut events, Some(&STEP)) {
        Ok(_) | Err(Errno::INTR) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Accepts connections while there are places and closes the others.
fn accept(listener: &TcpListener, clients: &mut Vec<Client>, places: usize, stderr: &StderrWriter) {
    while let Ok((stream, address)) = listener.accept() {
        if clients.len() == places {
            stderr.write(&format!("refused a client from {address}: {places} clients are connected\n"));
        } else {
            clients.extend(Client::accept(stream, clock::now_ns()));
        }
    }
}
