//! The one place that asks the machine for time. Cores never come here: they get time as an argument.
//!
//! All times are nanoseconds of `CLOCK_MONOTONIC`, the same for every process of a machine. Wall-clock
//! time serves only to name run folders.

#![allow(clippy::disallowed_methods)]

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Nanoseconds in a second.
pub const SECOND_NS: u64 = 1_000_000_000;

/// Now, ns of `CLOCK_MONOTONIC`.
pub fn now_ns() -> u64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec as u64 * SECOND_NS + now.tv_nsec as u64
}

/// Sleeps until `deadline_ns`; returns at once when it has passed, or early when a signal arrives.
pub fn sleep_until(deadline_ns: u64) {
    let deadline =
        Timespec { tv_sec: (deadline_ns / SECOND_NS) as i64, tv_nsec: (deadline_ns % SECOND_NS) as _ };
    match clock_nanosleep_absolute(ClockId::Monotonic, &deadline) {
        Ok(()) | Err(Errno::INTR) => {}
        Err(other) => unreachable!("CLOCK_MONOTONIC and a valid time were given: {other}"),
    }
}

/// Sleeps for about `duration`; for the rig's unhurried processes.
pub fn sleep(duration: Duration) {
    sleep_until(now_ns() + duration.as_nanos() as u64);
}

/// Wall-clock time since 1970-01-01 00:00 UTC, for the names of run folders.
pub fn wall_time() -> Duration {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default()
}
