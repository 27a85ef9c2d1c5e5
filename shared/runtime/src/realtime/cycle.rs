//! Deadlines on a fixed grid: the n-th at `epoch + phase + n · period`.

use std::convert::Infallible;

use super::{Account, Waiter};
use crate::clock;

/// Waits for the deadlines of a periodic task.
///
/// # Examples
/// ```
/// use masseter_runtime::clock;
/// use masseter_runtime::realtime::Cycle;
///
/// let mut cycle = Cycle::new(clock::now_ns() + 1_000_000, 1_000_000);
/// let (first, second) = (cycle.wait(), cycle.wait());
/// assert!(second.woke_ns >= second.due_ns);
/// assert_eq!(second.due_ns - first.due_ns, (second.cycle - first.cycle) * 1_000_000);
/// ```
///
/// Overrun policy: a deadline that the task is late for by less than a period is kept, late; those that passed before
/// are skipped and counted, never caught up in a burst. Cycle numbers keep counting deadlines, so a skipped one leaves a
/// gap.
#[derive(Debug)]
pub struct Cycle {
    first_due_ns: u64,
    period_ns: u64,
    waiter: Waiter,
    next: u64,
    skipped: u64,
}

/// A reached deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wake {
    /// Number of the deadline, from 1.
    pub cycle: u64,
    /// When it was due, ns.
    pub due_ns: u64,
    /// When the task woke, ns.
    pub woke_ns: u64,
    /// Deadlines skipped since the start.
    pub skipped: u64,
    /// The use of the task's time since the start.
    pub account: Account,
}

impl Wake {
    /// A deadline in virtual time, which is always met in time.
    pub fn on_time(cycle: u64, due_ns: u64) -> Self {
        Self { cycle, due_ns, woke_ns: due_ns, skipped: 0, account: Account::default() }
    }
}

impl Cycle {
    /// Deadlines every `period_ns` from `first_due_ns` on.
    pub fn new(first_due_ns: u64, period_ns: u64) -> Self {
        Self { first_due_ns, period_ns, waiter: Waiter::new(period_ns), next: 0, skipped: 0 }
    }

    /// When deadline `cycle` (from 1) is due, ns.
    fn due_ns(&self, cycle: u64) -> u64 {
        self.first_due_ns + (cycle - 1) * self.period_ns
    }

    /// When the next deadline is due, ns; it may have passed.
    pub fn next_due_ns(&self) -> u64 {
        self.due_ns(self.next + 1)
    }

    /// The next deadline that is less than a period past at `now_ns`, counting those before it as skipped.
    fn claim(&mut self, now_ns: u64) -> u64 {
        self.next += 1;
        let late_ns = now_ns.saturating_sub(self.due_ns(self.next));
        let missed = late_ns / self.period_ns;
        self.skipped += missed;
        self.next += missed;
        self.next
    }

    /// Waits for the next deadline: sleeps, then spins the last stretch.
    pub fn wait(&mut self) -> Wake {
        let Ok(wake) = self.wait_warm(|| Ok::<_, Infallible>(()));
        wake
    }

    /// As [`Self::wait`], with one call of `warm_up` shortly before the deadline if there is time for it: it may do work of
    /// the cycle early, and brings code and data back into the caches.
    ///
    /// # Errors
    /// Those of `warm_up`.
    pub fn wait_warm<E>(&mut self, warm_up: impl FnOnce() -> Result<(), E>) -> Result<Wake, E> {
        let cycle = self.claim(clock::now_ns());
        let due_ns = self.due_ns(cycle);
        let woke_ns = self.waiter.until_warm(due_ns, warm_up)?;
        Ok(Wake { cycle, due_ns, woke_ns, skipped: self.skipped, account: self.waiter.account() })
    }

    /// For the waits within a cycle.
    pub fn waiter(&mut self) -> &mut Waiter {
        &mut self.waiter
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: u64 = 1_000_000;

    #[test]
    fn deadlines_in_time_are_taken_one_by_one() {
        let mut cycle = Cycle::new(10 * PERIOD, PERIOD);
        assert_eq!(cycle.claim(0), 1);
        assert_eq!(cycle.claim(10 * PERIOD + 300), 2);
        assert_eq!(cycle.due_ns(2), 11 * PERIOD);
        assert_eq!(cycle.skipped, 0);
    }

    #[test]
    fn a_late_cycle_starts_late_but_is_not_skipped_within_its_period() {
        let mut cycle = Cycle::new(10 * PERIOD, PERIOD);
        cycle.claim(0);
        assert_eq!(cycle.claim(11 * PERIOD + PERIOD - 1), 2);
        assert_eq!(cycle.skipped, 0);
    }

    #[test]
    fn passed_deadlines_are_skipped_counted_and_never_caught_up() {
        let mut cycle = Cycle::new(10 * PERIOD, PERIOD);
        cycle.claim(0);
        assert_eq!(cycle.claim(15 * PERIOD + 7), 6);
        assert_eq!(cycle.skipped, 4);
        assert_eq!(cycle.claim(15 * PERIOD + 100), 7);
        assert_eq!(cycle.skipped, 4);
    }
}
