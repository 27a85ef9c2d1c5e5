//! The real-time loop: absolute deadlines on a fixed grid, the n-th at `epoch + phase + n · period`, and the scheduling
//! for them.
//!
//! [`Cycle`] waits for deadlines and applies the overrun policy. [`Waiter`] waits for an instant or for a message, and
//! measures stalls of the machine. [`scheduling`] requests a core, a real-time priority and locked memory, and reports
//! the kernel's grants. The work of a cycle is not part of this module.

pub mod scheduling;

use std::convert::Infallible;

use crate::clock;

/// A spinning task reads the clock every fraction of a microsecond, and the work of a cycle takes tens of microseconds. A
/// longer gap has another cause: an interrupt, the hypervisor, a task of higher priority. While the task works, the work
/// itself may be the cause, so [`Account`] keeps such gaps apart.
const GAP_NS: u64 = 50_000;
/// Shortest sleep of a wait that may end late: a sleep takes 20 to 40 µs of the core on some virtual machines.
const SHORTEST_SLEEP_NS: u64 = 50_000;
/// Upper bound of a warm-up, ns: tens of microseconds with cold caches.
const WARM_UP_NS: u64 = 25_000;
/// The longest margin, ns: a later wake-up is rare, and the machine's stalls are longer.
const LONGEST_MARGIN_NS: u64 = 200_000;
/// The shortest margin, ns: entering and leaving the kernel takes this long on a busy core.
const SHORTEST_MARGIN_NS: u64 = 5_000;
/// The margin is at most the period divided by this. Two loops at 10 kHz that spin for half of it starve the recorder
/// (notes/realtime-log.md).
const PARTS_OF_PERIOD: u64 = 3;
/// The margin covers this many times the latency.
const SAFETY_FACTOR: u64 = 2;
/// The surplus of the margin shrinks by one part in 2^12 with each sleep. So the margin keeps covering a latency of
/// once in a thousand cycles.
const DECAY: u32 = 12;

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
/// Overrun policy: a deadline less than a period past is kept, late. Earlier deadlines are skipped and counted, never
/// caught up in a burst. Cycle numbers count all deadlines, so a skipped deadline leaves a gap.
#[derive(Debug)]
pub struct Cycle {
    first_due_ns: u64,
    period_ns: u64,
    waiter: Waiter,
    next: u64,
    skipped: u64,
}

/// A reached deadline.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Wake {
    /// Number of the deadline, from 1.
    pub cycle: u64,
    /// Due time, ns.
    pub due_ns: u64,
    /// Wake-up time of the task, ns.
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

    /// Due time of deadline `cycle` (from 1), ns.
    fn due_ns(&self, cycle: u64) -> u64 {
        self.first_due_ns + (cycle - 1) * self.period_ns
    }

    /// Due time of the next deadline, possibly past, ns.
    pub fn next_due_ns(&self) -> u64 {
        self.due_ns(self.next + 1)
    }

    /// The next deadline that is less than a period past at `now_ns`. Earlier deadlines count as skipped.
    fn claim_deadline(&mut self, now_ns: u64) -> u64 {
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

    /// As [`Self::wait`], with one call of `warm_up` shortly before the deadline if there is time. `warm_up` may do
    /// work of the cycle early, and brings code and data back into the caches.
    ///
    /// # Errors
    /// Those of `warm_up`.
    pub fn wait_warm<E>(&mut self, warm_up: impl FnOnce() -> Result<(), E>) -> Result<Wake, E> {
        let cycle = self.claim_deadline(clock::now_ns());
        let due_ns = self.due_ns(cycle);
        let woke_ns = self.waiter.until_warm(due_ns, warm_up)?;
        Ok(Wake { cycle, due_ns, woke_ns, skipped: self.skipped, account: self.waiter.account() })
    }

    /// The waiter for the waits within a cycle.
    pub fn waiter(&mut self) -> &mut Waiter {
        &mut self.waiter
    }
}

/// The use of a task's time since its first wait, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Account {
    /// Stalls of the machine while waiting: late ends of sleeps, and gaps while spinning.
    pub stalled_ns: u64,
    /// Spinning, without the gaps.
    pub spun_ns: u64,
    /// Between waits.
    pub worked_ns: u64,
    /// The part of `worked_ns` in stretches longer than a gap. Either the machine has stalled or the work has taken too
    /// long; the task itself cannot distinguish the two.
    pub overlong_ns: u64,
}

/// The waits of a real-time task, and the account of its time. All time outside of waits counts as work.
#[derive(Debug)]
pub struct Waiter {
    /// A task spins for the last stretch before a deadline. A sleeping core takes tens of microseconds to wake up, a
    /// spinning core a tenth of a microsecond.
    margin: SpinMargin,
    account: Account,
    /// End of the last wait; none before the first wait.
    working_since_ns: Option<u64>,
}

impl Waiter {
    /// A waiter for a task of this period.
    pub fn new(period_ns: u64) -> Self {
        Self { margin: SpinMargin::new(period_ns), account: Account::default(), working_since_ns: None }
    }

    /// The account, with work up to the beginning of the last wait, and waits up to the last reading of the clock.
    pub fn account(&self) -> Account {
        self.account
    }

    /// Sleeps, calls `warm_up` once if there is time, and spins until `due_ns`; returns the time at the end. The
    /// warm-up counts as work. A core has cold caches after a sleep, so a warm-up is necessary.
    ///
    /// # Errors
    /// Those of `warm_up`.
    fn until_warm<E>(&mut self, due_ns: u64, warm_up: impl FnOnce() -> Result<(), E>) -> Result<u64, E> {
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

    /// Waits until `due_ns`, and at most until `latest_ns` if the core wakes up late. Spins only while a sleep of the
    /// usual wake-up latency would end after `latest_ns`. Returns the time at the end.
    pub fn until_between(&mut self, due_ns: u64, latest_ns: u64) -> u64 {
        let now_ns = self.end_work();
        let wake_ns = latest_ns.saturating_sub(self.margin.latency_ns()).min(due_ns);
        let is_worth_it = now_ns.saturating_add(SHORTEST_SLEEP_NS) < wake_ns;
        let now_ns = if is_worth_it { self.sleep(wake_ns, latest_ns, clock::sleep_until) } else { now_ns };
        self.spin_until(due_ns, now_ns)
    }

    /// Calls `block`, which sleeps in the kernel until an event, or until about `until_ns`. Spins instead when a sleep
    /// of the usual wake-up latency would end after `latest_ns`. Returns the time at the end.
    pub fn until_woken(&mut self, until_ns: u64, latest_ns: u64, block: impl FnOnce(u64)) -> u64 {
        let now_ns = self.end_work();
        let until_ns = latest_ns.saturating_sub(self.margin.latency_ns()).min(until_ns);
        if now_ns < until_ns { self.sleep(until_ns, latest_ns, block) } else { self.spin().now_ns() }
    }

    /// Spins from `from_ns` (now) until `due_ns`; returns the time at the end.
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

    /// Begins a spin.
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

/// A loop that reads the clock until its caller ends the loop.
#[derive(Debug)]
pub struct Spin<'a> {
    last_ns: u64,
    waiter: &'a mut Waiter,
}

impl Spin<'_> {
    /// Now, ns. The time since the last call counts as spun, or as stalled for a gap. The time after the last call
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

/// The stretch before a deadline that a task spins, ns: twice the recent wake-up latency, at most 200 µs and a third of the
/// period.
#[doc(alias("busy wait", "spin time"))]
#[derive(Debug)]
struct SpinMargin {
    longest_ns: u64,
    current_ns: u64,
}

impl SpinMargin {
    /// The margin of a task of this period: the longest margin, until sleeps have shown the latency.
    fn new(period_ns: u64) -> Self {
        let longest_ns = LONGEST_MARGIN_NS.min(period_ns / PARTS_OF_PERIOD);
        Self { longest_ns, current_ns: longest_ns }
    }

    /// The margin, but at least `least_ns` as far as the period allows, ns.
    fn at_least(&self, least_ns: u64) -> u64 {
        self.current_ns.max(least_ns.min(self.longest_ns))
    }

    /// The recent wake-up latency alone, for waits that may end late, ns.
    fn latency_ns(&self) -> u64 {
        self.current_ns / SAFETY_FACTOR
    }

    /// Adapts to a sleep with the latency `latency_ns`.
    fn learn(&mut self, latency_ns: u64) {
        if latency_ns > self.longest_ns {
            // A stall of the machine: no margin covers that.
            return;
        }
        let needed_ns = SAFETY_FACTOR * latency_ns + SHORTEST_MARGIN_NS;
        let surplus_ns = self.current_ns.saturating_sub(needed_ns);
        let learned_ns = needed_ns.max(self.current_ns - (surplus_ns >> DECAY));
        self.current_ns = learned_ns.clamp(SHORTEST_MARGIN_NS, self.longest_ns);
    }
}

#[cfg(test)]
mod tests;
