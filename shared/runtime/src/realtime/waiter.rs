//! Waiting for an instant or for a message, and measuring how long the machine stalled meanwhile.

use super::spin_margin::SpinMargin;
use crate::clock;

/// A spinning task reads the clock every fraction of a microsecond, and the work of a cycle takes tens of microseconds. A
/// longer gap has another cause: an interrupt, the hypervisor, a task of higher priority. While the task works, the work
/// itself may be the cause, so [`Account`] keeps such gaps apart.
const GAP_NS: u64 = 50_000;
/// A wait that may end late sleeps only for longer than this: a sleep takes 20 to 40 µs of the core on some virtual
/// machines.
const SHORTEST_SLEEP_NS: u64 = 50_000;

/// The use of a task's time since its first wait, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Account {
    /// Stalls of the machine while waiting: late ends of sleeps, and gaps while spinning.
    pub stalled_ns: u64,
    /// Spinning, without the gaps.
    pub spun_ns: u64,
    /// Between waits.
    pub worked_ns: u64,
    /// The part of `worked_ns` in stretches longer than a gap: either the machine stalled or the work took too long. The
    /// task itself cannot distinguish the two.
    pub overlong_ns: u64,
}

/// A warm-up takes less than this, ns: tens of microseconds with cold caches.
const WARM_UP_NS: u64 = 25_000;

/// How a real-time task waits, and the account of its time. All time outside of waits counts as work.
#[derive(Debug)]
pub struct Waiter {
    /// A task spins for the last stretch before a deadline: a sleeping core takes tens of microseconds to wake up, a
    /// spinning one a tenth of one.
    margin: SpinMargin,
    account: Account,
    /// Since when the task has not been waiting; none before its first wait.
    working_since_ns: Option<u64>,
}

impl Waiter {
    /// For a task of this period.
    pub fn new(period_ns: u64) -> Self {
        Self { margin: SpinMargin::new(period_ns), account: Account::default(), working_since_ns: None }
    }

    /// The account. It covers work up to the beginning of the last wait, and waiting up to the last reading of the clock.
    pub fn account(&self) -> Account {
        self.account
    }

    /// Sleeps, calls `warm_up` once if there is time for it, and spins until `due_ns`; returns the time at the end. The
    /// warm-up counts as work. It is needed because a core that slept has cold caches.
    ///
    /// # Errors
    /// Those of `warm_up`.
    pub(super) fn until_warm<E>(
        &mut self,
        due_ns: u64,
        warm_up: impl FnOnce() -> Result<(), E>,
    ) -> Result<u64, E> {
        let mut now_ns = self.end_work();
        let wake_ns = due_ns.saturating_sub(self.margin.at_least(2 * WARM_UP_NS));
        if now_ns < wake_ns {
            now_ns = self.sleep(wake_ns, due_ns, clock::sleep_until);
            if now_ns + WARM_UP_NS < due_ns {
                warm_up()?;
                now_ns = self.end_work();
            }
        }
        Ok(self.spin_until(due_ns, now_ns))
    }

    /// Waits until `due_ns`, and at most until `latest_ns` if the core wakes up late: spins only for the time in which a
    /// sleep of the usual wake-up latency would end after `latest_ns`. Returns the time at the end.
    pub fn until_between(&mut self, due_ns: u64, latest_ns: u64) -> u64 {
        let now_ns = self.end_work();
        let wake_ns = latest_ns.saturating_sub(self.margin.latency_ns()).min(due_ns);
        let is_worth_it = now_ns.saturating_add(SHORTEST_SLEEP_NS) < wake_ns;
        let now_ns = if is_worth_it { self.sleep(wake_ns, latest_ns, clock::sleep_until) } else { now_ns };
        self.spin_until(due_ns, now_ns)
    }

    /// Calls `block`, which sleeps in the kernel until an event, or until about `until_ns`. Spins instead if a sleep of the
    /// usual wake-up latency would end after `latest_ns`. Returns the time at the end.
    pub fn until_woken(&mut self, until_ns: u64, latest_ns: u64, block: impl FnOnce(u64)) -> u64 {
        let now_ns = self.end_work();
        let until_ns = latest_ns.saturating_sub(self.margin.latency_ns()).min(until_ns);
        if now_ns < until_ns { self.sleep(until_ns, latest_ns, block) } else { self.spin().now_ns() }
    }

    /// Spins from `from_ns`, which is now, until `due_ns`; returns the time at the end.
    fn spin_until(&mut self, due_ns: u64, from_ns: u64) -> u64 {
        if from_ns >= due_ns {
            self.working_since_ns = Some(from_ns);
            return from_ns;
        }
        let mut spin = Spin { last_ns: from_ns, waiter: self };
        loop {
            let now_ns = spin.now_ns();
            if now_ns >= due_ns {
                return now_ns;
            }
        }
    }

    /// Sleeps; returns the time at the end. The time after `latest_ns` is a stall.
    fn sleep(&mut self, until_ns: u64, latest_ns: u64, sleep: impl FnOnce(u64)) -> u64 {
        sleep(until_ns);
        let woke_ns = clock::now_ns();
        if let Some(latency_ns) = woke_ns.checked_sub(until_ns) {
            self.account.stalled_ns += woke_ns.saturating_sub(latest_ns);
            self.margin.learn(latency_ns);
        }
        self.working_since_ns = Some(woke_ns);
        woke_ns
    }

    /// Begins to spin.
    pub fn spin(&mut self) -> Spin<'_> {
        Spin { last_ns: self.end_work(), waiter: self }
    }

    /// Ends a stretch of work; returns the time. The next stretch begins at once, because a wait may end without a spin.
    fn end_work(&mut self) -> u64 {
        let now_ns = clock::now_ns();
        if let Some(since_ns) = self.working_since_ns.replace(now_ns) {
            let worked_ns = now_ns - since_ns;
            self.account.worked_ns += worked_ns;
            if worked_ns > GAP_NS {
                self.account.overlong_ns += worked_ns;
            }
        }
        now_ns
    }
}

/// A loop that reads the clock until its caller ends it.
#[derive(Debug)]
pub struct Spin<'a> {
    last_ns: u64,
    waiter: &'a mut Waiter,
}

impl Spin<'_> {
    /// Now, ns. The time since the last call counts as spun, or as stalled if it is a gap; the time after the last call
    /// counts as work.
    pub fn now_ns(&mut self) -> u64 {
        std::hint::spin_loop();
        let now_ns = clock::now_ns();
        let gap_ns = now_ns - self.last_ns;
        let account = &mut self.waiter.account;
        if gap_ns > GAP_NS {
            account.stalled_ns += gap_ns;
        } else {
            account.spun_ns += gap_ns;
        }
        self.last_ns = now_ns;
        self.waiter.working_since_ns = Some(now_ns);
        now_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::clock::SECOND_NS;

    const STALL: std::time::Duration = std::time::Duration::from_millis(2);
    const STALL_NS: u64 = 2_000_000;

    #[test]
    fn it_never_returns_early() {
        let mut waiter = Waiter::new(1_000_000);
        for ahead_ns in [0, 50_000, 2_000_000] {
            let due_ns = clock::now_ns() + ahead_ns;
            assert!(waiter.until_warm(due_ns, || Ok::<_, ()>(())).unwrap() >= due_ns);
        }
    }

    #[test]
    fn a_far_deadline_is_warmed_up_for_once_and_that_is_work() {
        let mut waiter = Waiter::new(1_000_000);
        let warmed_up = |waiter: &mut Waiter, ahead_ns: u64| {
            let mut calls = 0;
            let due_ns = clock::now_ns() + ahead_ns;
            let warm_up = || -> Result<(), ()> {
                calls += 1;
                Ok(())
            };
            assert!(waiter.until_warm(due_ns, warm_up).unwrap() >= due_ns);
            calls
        };
        assert_eq!(warmed_up(&mut waiter, 0), 0);
        // A machine that stalls leaves no time for a warm-up, but not each time.
        let calls: Vec<_> = (0..20).map(|_| warmed_up(&mut waiter, 5_000_000)).collect();
        assert!(calls.iter().all(|&calls| calls <= 1) && calls.contains(&1), "{calls:?}");
        assert!(waiter.account().worked_ns > 0);
        let failed =
            (0..20).any(|_| waiter.until_warm(clock::now_ns() + 5_000_000, || Err("no")) == Err("no"));
        assert!(failed);
    }

    #[test]
    fn a_wait_that_may_end_late_never_returns_early_and_leaves_the_spin_out() {
        let mut waiter = Waiter::new(1_000_000);
        for (ahead_ns, tolerance_ns) in [(0, 0), (20_000, 1_000_000), (2_000_000, 0), (2_000_000, 1_000_000)]
        {
            let due_ns = clock::now_ns() + ahead_ns;
            assert!(waiter.until_between(due_ns, due_ns + tolerance_ns) >= due_ns);
        }
        let spun_ns = waiter.account().spun_ns;
        let due_ns = clock::now_ns() + 2_000_000;
        waiter.until_between(due_ns, due_ns + 1_000_000);
        assert_eq!(waiter.account().spun_ns, spun_ns, "the longest margin is shorter than the tolerance");
    }

    #[test]
    fn a_blocking_wait_ends_with_its_event_and_does_not_count_as_work() {
        let mut waiter = Waiter::new(1_000_000);
        let begun_ns = clock::now_ns();
        let woken_ns = waiter.until_woken(begun_ns + SECOND_NS, begun_ns + SECOND_NS, |until_ns| {
            assert!(until_ns + 200_000 >= begun_ns + SECOND_NS, "{until_ns}");
            clock::sleep(STALL);
        });
        assert!((begun_ns + STALL_NS..begun_ns + SECOND_NS).contains(&woken_ns));
        assert_eq!(waiter.account().worked_ns, 0);
        // What is due at once is not blocked for.
        waiter.until_woken(0, 0, |_| panic!("blocked"));
    }

    #[test]
    fn a_gap_while_waiting_is_the_machines_and_a_long_stretch_of_work_is_kept_apart() {
        let mut waiter = Waiter::new(1_000_000);
        waiter.spin();
        let before = waiter.account();
        let mut spin = waiter.spin();
        clock::sleep(STALL);
        spin.now_ns();
        let stalled = waiter.account();
        assert!(stalled.stalled_ns >= before.stalled_ns + STALL_NS);

        clock::sleep(STALL);
        waiter.spin();
        let worked = waiter.account();
        assert_eq!(worked.stalled_ns, stalled.stalled_ns);
        assert!(worked.worked_ns >= stalled.worked_ns + STALL_NS);
        assert!(worked.overlong_ns >= stalled.overlong_ns + STALL_NS);
    }

    #[test]
    fn a_wait_that_ends_before_it_spins_counts_as_work() {
        let mut waiter = Waiter::new(1_000_000);
        waiter.spin();
        clock::sleep(STALL);
        waiter.spin();
        assert!(waiter.account().overlong_ns >= STALL_NS);
    }

    #[test]
    fn before_the_first_wait_nothing_is_accounted() {
        let mut waiter = Waiter::new(1_000_000);
        clock::sleep(STALL);
        waiter.spin();
        assert_eq!(waiter.account(), Account::default());
    }
}
