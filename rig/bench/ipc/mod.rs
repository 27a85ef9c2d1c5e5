//! `bench ipc`: one command there, one reading back, between two processes that poll.
//!
//! The rig's transport stands against bare iceoryx2 with the same messages, a Unix socket and a pipe with
//! 128 bytes, and the limit: one cache line bounced between two threads on the same two cores. Sockets and
//! pipe are polled too; waiting for them in the kernel takes some fifty times as long.

mod cache_line;
mod peer;
mod streams;
mod topics;

use anyhow::bail;
use masseter_shared::clock::{self, SECOND_NS};

pub use peer::{Channel, PeerArgs, answer};

use super::contender::{Durations, durations, record};
use super::contest::{Outcome, Turn};

/// Round trips a round; short enough that real-time throttling never strikes the polling threads.
const ROUND_TRIPS: u64 = 20_000;
/// Round trips before the measurement.
const WARM_UP: u64 = 1_000;
/// How long an answer may take before the bench gives up, ns.
const PATIENCE_NS: u64 = 10 * SECOND_NS;
/// Bytes of a message on socket and pipe.
const BYTES: usize = 128;
/// The limit, as it is called in results.
const CACHE_LINE: &str = "cache line (threads)";

pub(super) fn measure(rounds: u32, [own_core, peer_core]: [usize; 2]) -> anyhow::Result<Outcome> {
    let turn = |channel: Channel| -> (String, Turn) {
        let turn = move || Ok(round_trips(channel, [own_core, peer_core])?.into());
        (channel.in_words().to_owned(), Box::new(turn))
    };
    let mut turns: Vec<_> =
        [Channel::Rig, Channel::Iceoryx2, Channel::Socket, Channel::Pipe].map(turn).into();
    turns.push((
        CACHE_LINE.to_owned(),
        Box::new(move || Ok(cache_line::round_trips([own_core, peer_core])?.into())),
    ));
    let measures = "round trip between two polling processes on two cores".to_owned();
    let [rig, bare, socket, pipe] =
        [Channel::Rig, Channel::Iceoryx2, Channel::Socket, Channel::Pipe].map(Channel::in_words);
    Ok(Outcome::of_turns("ipc", measures, rounds, &[own_core, peer_core], turns)?.comparing([
        (rig, bare),
        (rig, CACHE_LINE),
        (rig, socket),
        (rig, pipe),
        (bare, CACHE_LINE),
    ]))
}

/// The other side starts first and from an ordinary thread: it would inherit a real-time thread's core and
/// priority, and starve behind its polling.
fn round_trips(channel: Channel, cores: [usize; 2]) -> anyhow::Result<Durations> {
    match channel {
        Channel::Rig => topics::round_trips::<topics::Ports>(channel, cores),
        Channel::Iceoryx2 => topics::round_trips::<topics::Bare>(channel, cores),
        Channel::Socket => streams::socket_round_trips(cores),
        Channel::Pipe => streams::pipe_round_trips(cores),
    }
}

/// Times round trips, numbered from 1.
fn time(mut round_trip: impl FnMut(u64) -> anyhow::Result<()>) -> anyhow::Result<Durations> {
    let mut taken = durations();
    for number in 1..=WARM_UP + ROUND_TRIPS {
        let from_ns = clock::now_ns();
        round_trip(number)?;
        let taken_ns = clock::now_ns() - from_ns;
        if number > WARM_UP {
            record(&mut taken, taken_ns, 1);
        }
    }
    Ok(taken)
}

/// Polls until `attempt` gives something; looks at the clock now and then only.
fn poll<T>(mut attempt: impl FnMut() -> anyhow::Result<Option<T>>) -> anyhow::Result<T> {
    let mut give_up_ns = None;
    loop {
        for _ in 0..10_000 {
            if let Some(got) = attempt()? {
                return Ok(got);
            }
            std::hint::spin_loop();
        }
        let now_ns = clock::now_ns();
        if now_ns > *give_up_ns.get_or_insert(now_ns + PATIENCE_NS) {
            bail!("the other side of the channel does not answer");
        }
    }
}
