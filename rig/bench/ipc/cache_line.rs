//! The lower bound of any exchange between two cores: one cache line that two polling threads write in turn.

use std::sync::atomic::{AtomicU64, Ordering};

use super::round_trips::{ROUND_TRIPS, WARM_UP, poll, time};
use crate::bench::candidate::Durations;
use crate::bench::thread::{on_core, realtime_on};

/// Alone on its cache line and on the line that the processor fetches with it.
#[repr(align(128))]
struct Line(AtomicU64);

/// One thread writes odd numbers, the other answers with the even ones.
pub(super) fn round_trips([own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let line = Line(AtomicU64::new(0));
    let wait_for = |number| poll(|| Ok((line.0.load(Ordering::Acquire) == number).then_some(())));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            realtime_on(peer_core);
            for number in 1..=WARM_UP + ROUND_TRIPS {
                // The other side fails for the same reason and returns the error.
                if wait_for(2 * number - 1).is_err() {
                    break;
                }
                line.0.store(2 * number, Ordering::Release);
            }
        });
        let round_trip = |number| {
            line.0.store(2 * number - 1, Ordering::Release);
            wait_for(2 * number)
        };
        on_core(own_core, || time(round_trip))
    })
}
