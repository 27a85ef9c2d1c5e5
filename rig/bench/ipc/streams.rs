//! A Unix socket and a pair of pipes, polled without blocking.

use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::process::Stdio;

use anyhow::Context;
use rustix::io::{Errno, ioctl_fionbio, read, write};

use super::channel::Channel;
use super::peer::Peer;
use super::round_trips::{poll, time};
use crate::bench::candidate::Durations;
use crate::bench::thread::on_core;

/// Bytes of a message.
const BYTES: usize = 128;

pub(super) fn socket_round_trips([own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let (own, peer) = UnixStream::pair()?;
    let _peer = Peer::start(Channel::Socket, peer_core, None, [OwnedFd::from(peer).into(), Stdio::null()])?;
    round_trips(own_core, &own, &own)
}

pub(super) fn pipe_round_trips([own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let mut peer = Peer::start(Channel::Pipe, peer_core, None, [Stdio::piped(), Stdio::piped()])?;
    let [there, back] = peer.pipes().context("both pipes were asked for")?;
    round_trips(own_core, &back, &there)
}

fn round_trips(
    core: usize,
    input: &(impl AsFd + Sync),
    output: &(impl AsFd + Sync),
) -> anyhow::Result<Durations> {
    let mut message = [0; BYTES];
    let mut round_trip = |_| {
        send(output, &message)?;
        receive(input, &mut message)
    };
    // The first round trip blocks until the other process has started.
    round_trip(0)?;
    unblock(input, output)?;
    on_core(core, || time(round_trip))
}

/// Sends every message back, until the channel closes.
pub(super) fn answer(input: &impl AsFd, output: &impl AsFd) -> anyhow::Result<()> {
    unblock(input, output)?;
    let mut message = [0; BYTES];
    loop {
        receive(input, &mut message)?;
        send(output, &message)?;
    }
}

fn unblock(input: &impl AsFd, output: &impl AsFd) -> anyhow::Result<()> {
    ioctl_fionbio(input, true)?;
    Ok(ioctl_fionbio(output, true)?)
}

/// At most one message is under way, so the channel always has room for it.
fn send(output: &impl AsFd, message: &[u8; BYTES]) -> anyhow::Result<()> {
    anyhow::ensure!(write(output, message)? == BYTES, "the channel took only part of a message");
    Ok(())
}

fn receive(input: &impl AsFd, message: &mut [u8; BYTES]) -> anyhow::Result<()> {
    let mut received = 0;
    while received < BYTES {
        received += poll(|| match read(input, &mut message[received..]) {
            Ok(0) => anyhow::bail!("the other side has gone"),
            Ok(bytes) => Ok(Some(bytes)),
            Err(Errno::AGAIN) => Ok(None),
            Err(error) => Err(error.into()),
        })?;
    }
    Ok(())
}
