//! `bench ipc`: a command to another process and a reading back; both processes poll.
//!
//! The rig's transport is compared with bare iceoryx2 and the same messages, with a Unix socket and a pipe (128 bytes, also
//! polled), and with the lower bound: one cache line that two threads on the same cores write in turn. Waiting for a
//! socket or pipe in the kernel is not measured; it takes about fifty times as long.

mod cache_line;
mod channel;
mod peer;
mod round_trips;
mod streams;
mod topics;

use std::io;

use clap::Args;
use masseter_shared::transport::Domain;
use rustix::process::{Signal, set_parent_process_death_signal};

pub use channel::Channel;

use super::candidate::Durations;
use super::comparison::{Comparison, Turn};
use super::thread::realtime_on;

/// The name of the lower bound in tables.
const CACHE_LINE: &str = "cache line (threads)";

pub(super) fn measure(rounds: u32, cores: [usize; 2]) -> anyhow::Result<Comparison> {
    let turn = |channel: Channel| -> (String, Turn) {
        (channel.name().to_owned(), Box::new(move || Ok(round_trips(channel, cores)?.into())))
    };
    let mut turns: Vec<_> =
        [Channel::Rig, Channel::Iceoryx2, Channel::Socket, Channel::Pipe].map(turn).into();
    turns.push((CACHE_LINE.to_owned(), Box::new(move || Ok(cache_line::round_trips(cores)?.into()))));
    let measures = "round trip between two polling processes on two cores".to_owned();
    let [rig, bare, socket, pipe] =
        [Channel::Rig, Channel::Iceoryx2, Channel::Socket, Channel::Pipe].map(Channel::name);
    let pairs = [(rig, bare), (rig, CACHE_LINE), (rig, socket), (rig, pipe), (bare, CACHE_LINE)];
    Ok(Comparison::by_turns("ipc", measures, rounds, &cores, turns)?.comparing(pairs))
}

/// The other process starts first and from an ordinary thread: from a real-time thread it would inherit core and priority,
/// and get no time while that thread polls.
fn round_trips(channel: Channel, cores: [usize; 2]) -> anyhow::Result<Durations> {
    match channel {
        Channel::Rig => topics::round_trips::<topics::Ports>(channel, cores),
        Channel::Iceoryx2 => topics::round_trips::<topics::Bare>(channel, cores),
        Channel::Socket => streams::socket_round_trips(cores),
        Channel::Pipe => streams::pipe_round_trips(cores),
    }
}

/// The arguments of the other process.
#[derive(Debug, Clone, Args)]
pub struct PeerArgs {
    /// The channel to answer on.
    #[arg(long, value_enum)]
    channel: Channel,
    /// The core to stay on.
    #[arg(long)]
    core: usize,
    /// The domain of the topics.
    #[arg(long)]
    domain: Option<String>,
}

/// Answers every message until the process is killed or the channel closes.
pub fn answer(args: &PeerArgs) -> anyhow::Result<()> {
    set_parent_process_death_signal(Some(Signal::KILL))?;
    let domain = args.domain.as_deref().map(Domain::named).transpose()?;
    realtime_on(args.core);
    match (args.channel, domain) {
        (Channel::Rig, Some(domain)) => topics::answer::<topics::Ports>(&domain),
        (Channel::Iceoryx2, Some(domain)) => topics::answer::<topics::Bare>(&domain),
        (Channel::Rig | Channel::Iceoryx2, None) => anyhow::bail!("topics need a domain"),
        (Channel::Socket, _) => streams::answer(&io::stdin(), &io::stdin()),
        (Channel::Pipe, _) => streams::answer(&io::stdin(), &io::stdout()),
    }
}
