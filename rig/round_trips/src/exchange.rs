//! Numbers that go to the other side and come back, whatever the channel.

use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{bail, ensure};
use masseter_runtime::clock::{self, SECOND_NS};

use crate::durations::{Durations, no_durations, record};
use crate::thread::{on_core, realtime_on};

/// Round trips per round; few enough that real-time throttling never stops the polling threads.
const ROUND_TRIPS: u64 = 20_000;
/// Round trips before the measurement.
const WARM_UP: u64 = 1_000;
/// The last number.
const LAST: u64 = WARM_UP + ROUND_TRIPS;
/// An answer that takes longer ends the bench, ns.
const TIMEOUT_NS: u64 = 10 * SECOND_NS;

/// The ends of a channel in one process.
#[expect(missing_debug_implementations, reason = "closures have none")]
pub struct Ends {
    /// Sends a number.
    pub send: Box<dyn FnMut(u64) -> anyhow::Result<()>>,
    /// The next number, if one is there.
    pub receive: Box<dyn FnMut() -> anyhow::Result<Option<u64>>>,
}

/// Times the way of every number to the other side and back.
///
/// # Errors
/// When the channel fails, or the other side does not answer.
pub fn round_trips(Ends { send, receive }: Ends) -> anyhow::Result<Durations> {
    timed(send, receive)
}

fn timed(
    mut send: impl FnMut(u64) -> anyhow::Result<()>,
    mut receive: impl FnMut() -> anyhow::Result<Option<u64>>,
) -> anyhow::Result<Durations> {
    let mut taken = no_durations();
    for number in 1..=LAST {
        let from_ns = clock::now_ns();
        send(number)?;
        let answer = poll(&mut receive)?;
        let taken_ns = clock::now_ns() - from_ns;
        ensure!(answer == number, "the answer to {number} was {answer}");
        if number > WARM_UP {
            record(&mut taken, taken_ns, 1);
        }
    }
    Ok(taken)
}

/// Sends every number back, until none comes any more.
///
/// # Errors
/// At the end of the channel.
pub fn answer(Ends { mut send, mut receive }: Ends) -> anyhow::Result<()> {
    loop {
        send(poll(&mut receive)?)?;
    }
}

/// Polls for the next number; reads the clock once in 10,000 attempts.
///
/// # Errors
/// When an attempt fails, or nothing comes within ten seconds.
fn poll(receive: &mut impl FnMut() -> anyhow::Result<Option<u64>>) -> anyhow::Result<u64> {
    let mut give_up_ns = None;
    loop {
        for _ in 0..10_000 {
            if let Some(number) = receive()? {
                return Ok(number);
            }
            std::hint::spin_loop();
        }
        let now_ns = clock::now_ns();
        if now_ns > *give_up_ns.get_or_insert(now_ns + TIMEOUT_NS) {
            bail!("the other side of the channel does not answer");
        }
    }
}

/// Alone on its cache line and on the line that the processor fetches with it.
#[repr(align(128))]
struct Line(AtomicU64);

/// The lower bound of any exchange between two cores: one cache line that two polling threads write in turn. One writes odd
/// numbers, the other answers with the even ones.
///
/// # Errors
/// When the other side does not answer.
pub fn on_a_cache_line([own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let line = &Line(AtomicU64::new(0));
    let write = |value| line.0.store(value, Ordering::Release);
    let read = |parity| {
        let value = line.0.load(Ordering::Acquire);
        Ok((value % 2 == parity).then_some(value.div_ceil(2)))
    };
    std::thread::scope(|scope| {
        scope.spawn(move || {
            realtime_on(peer_core);
            for _ in 1..=LAST {
                // The other side fails for the same reason and returns the error.
                let Ok(number) = poll(&mut || read(1)) else { break };
                write(2 * number);
            }
        });
        on_core(own_core, || {
            let ask = |number| {
                write(2 * number - 1);
                Ok(())
            };
            timed(ask, || read(0))
        })
    })
}
