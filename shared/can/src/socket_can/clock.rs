//! `CLOCK_MONOTONIC`, to which the wall-clock stamps of the kernel are converted.

// The stamps of a socket must be comparable with the times that its user passes in.
#![allow(clippy::disallowed_methods)]

use std::time::{Duration, SystemTime};

use rustix::time::{ClockId, clock_gettime};

/// An older stamp shows that the wall clock was set.
const MAX_AGE: Duration = Duration::from_secs(60);

/// Now, ns of `CLOCK_MONOTONIC`.
pub(super) fn now_ns() -> u64 {
    let time = clock_gettime(ClockId::Monotonic);
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

/// The instant of `CLOCK_MONOTONIC` at which the wall clock showed `stamp`, ns. A stamp in the future or more than a
/// minute old gives the present: the wall clock was set in between. The result never lies before the true instant,
/// unless the wall clock is set.
pub(super) fn monotonic_ns(stamp: SystemTime) -> u64 {
    // In this order, time between the two readings makes the result later, but never later than now.
    let wall = SystemTime::now();
    let now_ns = now_ns();
    match wall.duration_since(stamp) {
        Ok(age) if age < MAX_AGE => now_ns.saturating_sub(age.as_nanos() as u64),
        _ => now_ns,
    }
}

#[cfg(test)]
mod tests {
    use std::time::UNIX_EPOCH;

    use super::*;

    #[test]
    fn a_stamp_of_the_wall_clock_lies_between_the_monotonic_readings_around_it() {
        let before_ns = now_ns();
        let stamp = SystemTime::now();
        let after_ns = now_ns();
        assert!(monotonic_ns(stamp) >= before_ns);
        assert!(monotonic_ns(SystemTime::now()) >= after_ns, "a later stamp lies later");
    }

    #[test]
    fn an_old_stamp_is_converted_by_its_age() {
        let stamp = SystemTime::now() - Duration::from_secs(30);
        let found_ns = monotonic_ns(stamp);
        assert!(found_ns + 20_000_000_000 < now_ns(), "{found_ns}");
    }

    #[test]
    fn a_stamp_of_a_clock_that_was_set_meanwhile_counts_as_now() {
        for stamp in [UNIX_EPOCH, SystemTime::now() + Duration::from_secs(3600)] {
            let before_ns = now_ns();
            assert!(monotonic_ns(stamp) >= before_ns);
        }
    }
}
