//! Waiting for an instant or for a message, and noticing when the machine stood still meanwhile.

use super::load::Load;
use super::preparation::Preparation;
use super::reserve::Reserve;
use crate::clock;

/// A spinning task reads the clock every fraction of a microsecond, and a cycle's work is done in tens of
/// them. A gap longer than this was spent elsewhere: interrupts, the hypervisor, a task of higher
/// priority; or, while working, in the work itself, which [`Account`] therefore keeps apart.
const GAP_NS: u64 = 50_000;

/// What a task's time went to since its first wait, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Account {
    /// Withheld while waiting: late returns from sleep, and gaps while spinning. A waiting task does
    /// nothing, so this is the machine's doing.
    pub stalled_ns: u64,
    /// Spinning, without the gaps.
    pub spun_ns: u64,
    /// Between waits.
    pub worked_ns: u64,
    /// The part of `worked_ns` in stretches so long that either the machine stood still or the work took
    /// too long; which of them cannot be told from within.
    pub overlong_ns: u64,
}

/// How a real-time task waits, and the account of its time: whatever is not waiting counts as work.
#[derive(Debug)]
pub struct Waiter {
    /// The last stretch before a deadline is spun, not slept: a sleeping core takes tens of microseconds to
    /// come back, a spinning one a tenth of one.
    reserve: Reserve,
    preparation: Preparation,
    load: Load,
    account: Account,
    /// Since when the task has not been waiting; none before its first wait.
    working_since_ns: Option<u64>,
}

impl Waiter {
    /// For a task of this period.
    pub fn new(period_ns: u64) -> Self {
        Self {
            reserve: Reserve::new(period_ns),
            preparation: Preparation::new(period_ns),
            load: Load::default(),
            account: Account::default(),
            working_since_ns: None,
        }
    }

    /// The account: of work up to the begin of the last wait, of waiting up to the last look at the clock.
    pub fn account(&self) -> Account {
        self.account
    }

    /// Sleeps, then spins until `due_ns`; returns the time found at the end.
    pub fn until(&mut self, due_ns: u64) -> u64 {
        let now_ns = self.sleep_before(due_ns);
        self.spin_until(due_ns, now_ns)
    }

    /// As [`Self::until`]; does what can be done by then instead of a part of the spin.
    ///
    /// # Errors
    /// That of the work.
    pub fn until_working<E>(
        &mut self,
        due_ns: u64,
        work: impl FnOnce(u64) -> Result<(), E>,
    ) -> Result<u64, E> {
        let now_ns = self.sleep_before(due_ns);
        self.working_since_ns = Some(now_ns);
        work(now_ns)?;
        let now_ns = self.end_work();
        Ok(self.spin_until(due_ns, now_ns))
    }

    /// Sleeps for as long as a sleep is worth it; returns the time found at its end.
    fn sleep_before(&mut self, due_ns: u64) -> u64 {
        let now_ns = self.end_work();
        if let Some(used) = self.load.look(now_ns, self.account.spun_ns + self.account.worked_ns) {
            self.reserve.yield_to_others(used);
            self.preparation.yield_to_others(used);
        }
        let sleep_until_ns = due_ns.saturating_sub(self.reserve.ns());
        if now_ns < sleep_until_ns { self.sleep(sleep_until_ns) } else { now_ns }
    }

    /// As [`Self::until`]; before a deadline that is far, wakes early enough to `prepare`, which counts as work. As long
    /// as there is time for it, `prepare` is called again: what it did last is what is still there when the time has come.
    pub(super) fn until_preparing<E>(
        &mut self,
        due_ns: u64,
        mut prepare: impl FnMut() -> Result<(), E>,
    ) -> Result<u64, E> {
        let Some(begin_ns) = self.preparation.begin_ns(clock::now_ns(), due_ns) else {
            return Ok(self.until(due_ns));
        };
        let began_ns = self.until(begin_ns);
        prepare()?;
        let mut now_ns = self.end_work();
        self.preparation.learn_first(now_ns - began_ns);
        while self.preparation.fits(now_ns, due_ns) {
            prepare()?;
            let took_ns = clock::now_ns() - now_ns;
            self.account_for_repeat(took_ns);
            now_ns += took_ns;
        }
        Ok(self.spin_until(due_ns, now_ns))
    }

    fn account_for_repeat(&mut self, took_ns: u64) {
        let worked_ns = self.preparation.learn_repeat(took_ns);
        self.account.worked_ns += worked_ns;
        self.account.stalled_ns += took_ns - worked_ns;
        self.working_since_ns = self.working_since_ns.map(|since_ns| since_ns + took_ns);
    }

    /// Returns the time found at its end, or `from_ns`, found just now, where there is nothing to wait for.
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

    /// Returns the time found at its end.
    fn sleep(&mut self, until_ns: u64) -> u64 {
        self.load.count_sleep();
        clock::sleep_until(until_ns);
        let woke_ns = clock::now_ns();
        let late_ns = woke_ns.saturating_sub(until_ns);
        // Within the reserve a late return costs nothing.
        self.account.stalled_ns += late_ns.saturating_sub(self.reserve.ns());
        self.reserve.learn(late_ns);
        self.working_since_ns = None;
        woke_ns
    }

    /// Begins to spin.
    pub fn spin(&mut self) -> Spin<'_> {
        Spin { last_ns: self.end_work(), waiter: self }
    }

    /// Ends a stretch of work; returns the time. Until a wait really spins, the next stretch runs.
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

/// A spin in progress: reads the clock again and again.
#[derive(Debug)]
pub struct Spin<'a> {
    last_ns: u64,
    waiter: &'a mut Waiter,
}

impl Spin<'_> {
    /// Now; counts the gap since the last call if it is one. Whatever follows the last call is work.
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
            assert!(waiter.until(due_ns) >= due_ns);
        }
    }

    #[test]
    fn a_far_deadline_is_prepared_for_and_its_repeats_are_work() {
        let mut waiter = Waiter::new(1_000_000);
        let mut prepared = 0;
        let mut prepare = || -> Result<(), ()> {
            prepared += 1;
            Ok(())
        };
        for ahead_ns in [0, 20_000_000] {
            let due_ns = clock::now_ns() + ahead_ns;
            assert!(waiter.until_preparing(due_ns, &mut prepare).unwrap() >= due_ns);
        }
        assert!(prepared > 0);
        assert!(waiter.account().worked_ns > 0);
        assert_eq!(waiter.until_preparing(clock::now_ns() + 20_000_000, || Err("no")), Err("no"));
    }

    #[test]
    fn work_before_a_deadline_is_accounted_as_such() {
        let mut waiter = Waiter::new(1_000_000);
        let due_ns = clock::now_ns() + SECOND_NS / 100;
        let work = |_| -> Result<(), ()> {
            clock::sleep(STALL);
            Ok(())
        };
        assert!(waiter.until_working(due_ns, work).unwrap() >= due_ns);
        assert!(waiter.account().worked_ns >= STALL_NS);
        assert_eq!(waiter.until_working(0, |_| Err("no")), Err("no"));
    }

    #[test]
    fn waits_that_leave_no_time_to_sleep_make_the_reserve_give_way() {
        let mut waiter = Waiter::new(60_000);
        let at_first_ns = waiter.reserve.ns();
        let until_ns = clock::now_ns() + SECOND_NS;
        while waiter.reserve.ns() == at_first_ns && clock::now_ns() < until_ns {
            waiter.until(clock::now_ns() + at_first_ns / 2);
        }
        assert!(waiter.reserve.ns() < at_first_ns);
    }

    #[test]
    fn a_gap_while_waiting_is_the_machines_and_a_long_stretch_of_work_is_kept_apart() {
        let mut waiter = Waiter::new(1_000_000);
        waiter.until(0);
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
    fn a_wait_whose_end_has_come_before_it_spins_belongs_to_the_work_around_it() {
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
