//! The process on the other side of a channel.

use std::io;
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};

use clap::ValueEnum;
use masseter_shared::transport::Domain;

use super::channel::Channel;

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
