//! The process on the other side of a channel.

use std::io::{self, Read};
use std::process::{Child, Command, Stdio};

use anyhow::Context;

use masseter_round_trips::Channel;

use crate::arguments::name_of;

/// A running peer; killed when dropped.
pub(super) struct Peer(Child);

impl Peer {
    /// Starts this executable as the other side, and waits until its end of the channel is open.
    pub(super) fn start(channel: Channel, core: usize, domain: &str, input: Stdio) -> anyhow::Result<Self> {
        let mut peer = Self(
            Command::new(std::env::current_exe()?)
                .args(["bench-peer", "--channel", &name_of(&channel), "--core", &core.to_string()])
                .args(["--domain", domain])
                .stdin(input)
                .stdout(Stdio::piped())
                .spawn()?,
        );
        let output = peer.0.stdout.as_mut().expect("standard output is piped");
        output.read_exact(&mut [0]).context("the other side did not open its end")?;
        Ok(peer)
    }
}

/// Reports that this process has opened its end.
pub(super) fn report_open() -> anyhow::Result<()> {
    Ok(rustix::io::write(io::stdout(), b"\n").map(drop)?)
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended by itself; then there is nothing left to kill.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}
