//! The one place that asks the machine for time. Cores never ask: they get time as an argument.
//!
//! All times are nanoseconds of `CLOCK_MONOTONIC`, the same for every process of a machine. Wall-clock
//! time names and dates runs, and dates what the kernel stamps.

#![allow(clippy::disallowed_methods)]

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustix::io::Errno;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};

/// Nanoseconds in a second.
pub const SECOND_NS: u64 = 1_000_000_000;
/// Nanoseconds in a millisecond.
pub const MILLISECOND_NS: u64 = 1_000_000;
/// What older stamps of the wall clock say is that it was set.
const PLAUSIBLE_AGE: Duration = Duration::from_secs(60);

/// Two readings in a row take far less than this, ns.
const UNDISTURBED_NS: u64 = 10_000;

/// Now, ns of `CLOCK_MONOTONIC`.
pub fn now_ns() -> u64 {
    read_ns(ClockId::Monotonic)
}

/// CPU time that the calling thread has used, ns. A system call.
pub fn thread_cpu_ns() -> u64 {
    read_ns(ClockId::ThreadCPUTime)
}

fn read_ns(clock: ClockId) -> u64 {
    let time = clock_gettime(clock);
    time.tv_sec as u64 * SECOND_NS + time.tv_nsec as u64
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

/// The instant of `CLOCK_MONOTONIC` at which the wall clock showed `stamp`, ns; now, if that lies in the
/// future or more than a minute back, because the wall clock was set meanwhile. Never before the true
/// instant, as long as the wall clock is not set.
pub fn monotonic_ns(stamp: SystemTime) -> u64 {
    // In this order, what passes between the two readings makes the result later, but never later than now.
    let wall = SystemTime::now();
    let now_ns = now_ns();
    match wall.duration_since(stamp) {
        Ok(age) if age < PLAUSIBLE_AGE => now_ns.saturating_sub(age.as_nanos() as u64),
        _ => now_ns,
    }
}

/// By how much the wall clock is ahead of `CLOCK_MONOTONIC`, ns; none when something came between the two readings. It
/// jumps when the clock is set, and when the machine was suspended.
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
    fn a_stamp_of_the_wall_clock_lies_between_the_monotonic_readings_around_it() {
        let before_ns = now_ns();
        let stamp = SystemTime::now();
        let after_ns = now_ns();
        assert!(monotonic_ns(stamp) >= before_ns);
        // A second stamp taken later lies later.
        assert!(monotonic_ns(SystemTime::now()) >= after_ns);
    }

    #[test]
    fn an_old_stamp_lies_where_its_age_says() {
        let stamp = SystemTime::now() - Duration::from_secs(30);
        let found_ns = monotonic_ns(stamp);
        assert!(found_ns + 20 * SECOND_NS < now_ns(), "{found_ns}");
    }

    #[test]
    fn the_wall_clock_keeps_its_distance() {
        let look = || (0..1000).find_map(|_| wall_ahead_ns()).expect("one of many looks is undisturbed");
        assert!((look() - look()).abs() < 1_000_000);
    }

    #[test]
    fn a_stamp_of_a_clock_set_meanwhile_counts_as_now() {
        for stamp in [UNIX_EPOCH, SystemTime::now() + Duration::from_secs(3600)] {
            let before_ns = now_ns();
            assert!(monotonic_ns(stamp) >= before_ns);
        }
    }
}
