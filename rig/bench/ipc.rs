//! `bench ipc`: a command to another process and a reading back; both processes poll.
//!
//! The rig's transport is compared with bare iceoryx2 and the same messages, with a Unix socket (128 bytes, also polled),
//! and with the lower bound: one cache line that two threads on the same cores write in turn. Waiting for a socket in the
//! kernel is not measured; it takes about fifty times as long.

use std::io;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;

use clap::Args;
use masseter_round_trips::{Channel, Durations, on_core, realtime_on};
use masseter_runtime::transport::{Domain, ScratchDomain};
use rustix::process::{Signal, set_parent_process_death_signal};

use super::comparison::{Comparison, Turn};
use super::peer::{Peer, report_open};

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Comparison> {
    const RIG: &str = "masseter transport";
    const BARE: &str = "bare iceoryx2";
    const SOCKET: &str = "Unix socket";
    const CACHE_LINE: &str = "cache line (threads)";
    let turn = |channel| -> Turn { Box::new(move || Ok(round_trips(channel, cores)?.into())) };
    let turns = vec![
        (RIG, turn(Channel::Rig)),
        (BARE, turn(Channel::Iceoryx2)),
        (SOCKET, turn(Channel::Socket)),
        (CACHE_LINE, Box::new(move || Ok(masseter_round_trips::on_a_cache_line(cores)?.into()))),
    ];
    let measures = "round trip between two polling processes on two cores";
    let pairs = [(RIG, BARE), (RIG, CACHE_LINE), (RIG, SOCKET), (BARE, CACHE_LINE)];
    Ok(Comparison::by_turns("ipc", measures, rounds, &cores, turns)?.comparing(pairs))
}

/// Round trips over bare iceoryx2.
pub(super) fn bare_round_trips(cores: [usize; 2]) -> anyhow::Result<Durations> {
    round_trips(Channel::Iceoryx2, cores)
}

/// The other process starts first and from an ordinary thread: from a real-time thread it would inherit core and priority,
/// and get no time while that thread polls.
fn round_trips(channel: Channel, [own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let domain = ScratchDomain::claim("bench")?;
    let (own, peer) = UnixStream::pair()?;
    let _peer = Peer::start(channel, peer_core, domain.id(), OwnedFd::from(peer).into())?;
    on_core(own_core, || masseter_round_trips::round_trips(channel.asking(&domain, own)?))
}

/// The arguments of the other process.
#[derive(Debug, Clone, Args)]
pub(crate) struct PeerArgs {
    /// The channel to answer on.
    #[arg(long, value_enum)]
    channel: Channel,
    /// The core to stay on.
    #[arg(long)]
    core: usize,
    /// The domain of the topics.
    #[arg(long)]
    domain: String,
}

/// Answers every message until the process is killed or the channel closes. The socket is standard input.
pub(crate) fn answer(args: &PeerArgs) -> anyhow::Result<()> {
    set_parent_process_death_signal(Some(Signal::KILL))?;
    realtime_on(args.core);
    let socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let ends = args.channel.answering(&Domain::named(&args.domain)?, socket)?;
    report_open()?;
    masseter_round_trips::answer(ends)
}
