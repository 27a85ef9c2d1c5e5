//! Waiting for an instant or for a message, and noticing when the machine stood still meanwhile.

use crate::clock;

/// The last stretch before a deadline is spun, not slept: a sleeping core takes tens of
/// microseconds to come back, a spinning one a tenth of one.
const SPIN_NS: u64 = 200_000;
/// The spin takes at most this share of a period, so that real-time throttling never strikes and the
/// rest of the machine lives.
const SPIN_SHARE: u64 = 4;
/// A spinning task reads the clock every fraction of a microsecond. A gap longer than this was spent
/// elsewhere: interrupts, the hypervisor, a task of higher priority.
const GAP_NS: u64 = 50_000;

/// How a real-time task waits. Never used for anything but waiting, so the time it loses is the
/// machine's doing, not the task's.
#[derive(Debug)]
pub struct Waiter {
    spin_ns: u64,
    stalled_ns: u64,
}

impl Waiter {
    /// For a task of this period.
    pub fn new(period_ns: u64) -> Self {
        Self { spin_ns: SPIN_NS.min(period_ns / SPIN_SHARE), stalled_ns: 0 }
    }

    /// Time withheld since the start: late returns from sleep, and gaps while spinning.
    pub fn stalled_ns(&self) -> u64 {
        self.stalled_ns
    }

    /// Sleeps, then spins until `due_ns`; returns the time found at the end.
    pub fn until(&mut self, due_ns: u64) -> u64 {
        let sleep_until_ns = due_ns.saturating_sub(self.spin_ns);
        if clock::now_ns() < sleep_until_ns {
            clock::sleep_until(sleep_until_ns);
            let late_ns = clock::now_ns().saturating_sub(sleep_until_ns);
            // Within the spin's reserve a late return costs nothing.
            self.stalled_ns += late_ns.saturating_sub(self.spin_ns);
        }
        let mut spin = self.spin();
        loop {
            let now_ns = spin.now_ns();
            if now_ns >= due_ns {
                return now_ns;
            }
        }
    }

    /// Begins to spin.
    pub fn spin(&mut self) -> Spin<'_> {
        Spin { last_ns: clock::now_ns(), stalled_ns: &mut self.stalled_ns }
    }
}

/// A spin in progress: reads the clock again and again.
#[derive(Debug)]
pub struct Spin<'a> {
    last_ns: u64,
    stalled_ns: &'a mut u64,
}

impl Spin<'_> {
    /// Now; counts the gap since the last call if it is one.
    pub fn now_ns(&mut self) -> u64 {
        std::hint::spin_loop();
        let now_ns = clock::now_ns();
        let gap_ns = now_ns - self.last_ns;
        if gap_ns > GAP_NS {
            *self.stalled_ns += gap_ns;
        }
        self.last_ns = now_ns;
        now_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_never_returns_early_and_gaps_are_counted() {
        let mut waiter = Waiter::new(1_000_000);
        for ahead_ns in [0, 50_000, 2_000_000] {
            let due_ns = clock::now_ns() + ahead_ns;
            assert!(waiter.until(due_ns) >= due_ns);
        }
        let before_ns = waiter.stalled_ns();
        let mut spin = waiter.spin();
        clock::sleep(std::time::Duration::from_millis(2));
        spin.now_ns();
        assert!(waiter.stalled_ns() >= before_ns + 2_000_000);
    }
}
