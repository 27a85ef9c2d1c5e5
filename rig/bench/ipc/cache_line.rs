//! The limit of any exchange between two cores: one cache line, bounced by two polling threads.

use std::hint::spin_loop;
use std::sync::atomic::{AtomicU64, Ordering};

use super::{ROUND_TRIPS, WARM_UP, time};
use crate::bench::contest::Durations;
use crate::bench::{on_core, realtime_on};

/// Alone on its line, and on the one that is fetched along with it.
#[repr(align(128))]
struct Line(AtomicU64);

/// One thread writes odd numbers, the other answers with the even ones.
pub(super) fn round_trips([own_core, peer_core]: [usize; 2]) -> anyhow::Result<Durations> {
    let line = Line(AtomicU64::new(0));
    let wait_for = |number| {
        while line.0.load(Ordering::Acquire) != number {
            spin_loop();
        }
    };
    std::thread::scope(|scope| {
        scope.spawn(|| {
            realtime_on(peer_core);
            for number in 1..=WARM_UP + ROUND_TRIPS {
                wait_for(2 * number - 1);
                line.0.store(2 * number, Ordering::Release);
            }
        });
        let round_trip = |number| {
            line.0.store(2 * number - 1, Ordering::Release);
            wait_for(2 * number);
            Ok(())
        };
        on_core(own_core, || time(round_trip))
    })
}
