//! The process on the other side of a channel.

use std::io;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};

use clap::{Args, ValueEnum};
use masseter_shared::transport::Domain;
use rustix::process::{Signal, set_parent_process_death_signal};

use super::{streams, topics};
use crate::bench::realtime_on;

/// A channel between two processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Channel {
    /// The rig's transport.
    Rig,
    /// Bare iceoryx2.
    Iceoryx2,
    /// A Unix stream socket.
    Socket,
    /// Two pipes.
    Pipe,
}

impl Channel {
    pub(super) fn in_words(self) -> &'static str {
        match self {
            Self::Rig => "masseter transport",
            Self::Iceoryx2 => "bare iceoryx2",
            Self::Socket => "Unix socket",
            Self::Pipe => "pipe",
        }
    }
}

/// What the other side is started with.
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

/// A running peer; killed when dropped.
pub(super) struct Peer(pub(super) Child);

impl Peer {
    /// Starts this executable as the other side.
    pub(super) fn start(
        channel: Channel,
        core: usize,
        domain: Option<&Domain>,
        [input, output]: [Stdio; 2],
    ) -> io::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        let value = channel.to_possible_value().expect("no channel is skipped");
        command.args(["bench-peer", "--channel", value.get_name(), "--core", &core.to_string()]);
        if let Some(domain) = domain {
            command.args(["--domain", domain.id()]);
        }
        Ok(Self(command.stdin(input).stdout(output).spawn()?))
    }

    /// Takes the pipes to and from the peer.
    pub(super) fn pipes(&mut self) -> Option<[OwnedFd; 2]> {
        Some([self.0.stdin.take()?.into(), self.0.stdout.take()?.into()])
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing left to kill.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
