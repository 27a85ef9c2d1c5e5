//! Timing of round trips, and polling for an answer.

use anyhow::bail;
use masseter_shared::clock::{self, SECOND_NS};

use crate::bench::candidate::{Durations, no_durations, record};

/// Round trips per round; few enough that real-time throttling never stops the polling threads.
pub(super) const ROUND_TRIPS: u64 = 20_000;
/// Round trips before the measurement.
pub(super) const WARM_UP: u64 = 1_000;
/// An answer that takes longer ends the bench, ns.
const TIMEOUT_NS: u64 = 10 * SECOND_NS;

/// Times round trips, numbered from 1.
pub(super) fn time(mut round_trip: impl FnMut(u64) -> anyhow::Result<()>) -> anyhow::Result<Durations> {
    let mut taken = no_durations();
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

/// Polls until `attempt` returns something; reads the clock once in 10,000 attempts.
///
/// # Errors
/// When an attempt fails, or nothing comes within ten seconds.
pub(super) fn poll<T>(mut attempt: impl FnMut() -> anyhow::Result<Option<T>>) -> anyhow::Result<T> {
    let mut give_up_ns = None;
    loop {
        for _ in 0..10_000 {
            if let Some(got) = attempt()? {
                return Ok(got);
            }
            std::hint::spin_loop();
        }
        let now_ns = clock::now_ns();
        if now_ns > *give_up_ns.get_or_insert(now_ns + TIMEOUT_NS) {
            bail!("the other side of the channel does not answer");
        }
    }
}
