//! The rig's only access to the machine's clocks. Cores get time as an argument.
//!
//! All times are nanoseconds of `CLOCK_MONOTONIC`, the same for every process of a machine. Wall-clock
//! time is for the names and dates of runs.

#![allow(clippy::disallowed_methods)]

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustix::time::{ClockId, Timespec, clock_gettime};
use rustix::{io::Errno, thread::clock_nanosleep_absolute};

/// Nanoseconds in a second.
pub const SECOND_NS: u64 = 1_000_000_000;
/// Nanoseconds in a millisecond.
pub const MILLISECOND_NS: u64 = 1_000_000;

/// Far more than the time of two readings in a row, ns.
const UNDISTURBED_NS: u64 = 10_000;

/// Now, ns of `CLOCK_MONOTONIC`.
pub fn now_ns() -> u64 {
    read_ns(ClockId::Monotonic)
}

fn read_ns(clock: ClockId) -> u64 {
    let time = clock_gettime(clock);
    time.tv_sec as u64 * SECOND_NS + time.tv_nsec as u64
}

/// Sleeps until `deadline_ns`. Returns at once for a past deadline, and early on a signal.
pub fn sleep_until(deadline_ns: u64) {
    let deadline =
        Timespec { tv_sec: (deadline_ns / SECOND_NS) as i64, tv_nsec: (deadline_ns % SECOND_NS) as _ };
    match clock_nanosleep_absolute(ClockId::Monotonic, &deadline) {
        Ok(()) | Err(Errno::INTR) => {}
        Err(other) => unreachable!("CLOCK_MONOTONIC and a valid time were given: {other}"),
    }
}

/// Sleeps for about `duration`; for processes without deadlines.
pub fn sleep(duration: Duration) {
    sleep_until(now_ns() + duration.as_nanos() as u64);
}

/// Lead of the wall clock over `CLOCK_MONOTONIC`, ns; none after an interruption between the readings. The value jumps
/// when the clock is set, and after a suspension of the machine.
pub fn wall_ahead_ns() -> Option<i64> {
    let (before_ns, wall_ns, after_ns) = (now_ns(), read_ns(ClockId::Realtime), now_ns());
    (after_ns - before_ns < UNDISTURBED_NS).then(|| wall_ns as i64 - before_ns as i64)
}

/// Wall-clock time since 1970-01-01 00:00 UTC, for the names of run folders.
pub fn wall_time() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_difference_of_the_clocks_is_constant() {
        let look = || (0..1000).find_map(|_| wall_ahead_ns()).expect("one of many looks is undisturbed");
        assert!((look() - look()).abs() < 1_000_000);
    }
}
