//! Skipped deadlines, what the time before them went to, and whether rig or machine caused them.
//!
//! The machine caused a skip that stalls while the process waited explain. A skip that only an overlong stretch of work
//! explains may have either cause: the [counters](crate::overruns) of the loop's thread name it, and where they cannot,
//! [`OverrunAttribution`] weighs those of the whole run. The rig caused all others.
//!
//! A process that skips n deadlines comes back at least n + 1 periods after the last one that it kept. A cycle in time
//! takes one of them at most; the other n were lost, to stalls or to overlong work. Lost time explains as many skips as
//! it has whole periods, so less than a period explains none.
//!
//! Two losses count: that in the cycle before the skip, and the part of earlier losses that is carried over. A process
//! that wakes late carries over as much as it is late; one that wakes in time carries over nothing.
//!
//! Where messages are missing from the recording, single cycles are unknown: skips in between have no known cause, and
//! the time lost in between is not counted as one stall.

use std::cmp::Reverse;

use masseter_runtime::messages::{Reading, State};
use serde::Serialize;

use crate::measured::Durations;
use crate::overruns::{LoopSamples, Overrun, OverrunCause};

/// Skipped deadlines of one process, and the account of its time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SkipFigures {
    /// Deadlines skipped.
    pub skipped: u64,
    /// Those before which the machine stalled for whole periods while the process waited.
    pub by_machine: u64,
    /// Those before which a stretch of work took too long.
    pub while_working: u64,
    /// Those of them that the counters of the loop's thread show to be the loop's own.
    pub working_by_loop: u64,
    /// Those that they show to be the machine's.
    pub working_by_machine: u64,
    /// Those behind messages that were not recorded, and those that passed before the first wait.
    pub unknown_cause: u64,
    /// Those of a stall that a fault of the scenario made.
    pub by_scenario: u64,
    /// Time for which the machine stalled while the process waited, ns.
    pub stalled_ns: u64,
    /// Time that the process spun, without the stalls, ns.
    pub spun_ns: u64,
    /// Time that the process worked, ns.
    pub worked_ns: u64,
    /// Part of it in stretches too long for the work alone, ns.
    pub overlong_ns: u64,
}

impl SkipFigures {
    /// Those after overlong work of which nobody knows the cause.
    pub(crate) fn working_undecided(&self) -> u64 {
        self.while_working.saturating_sub(self.working_by_loop + self.working_by_machine)
    }
}

/// Counters of a process since its start, and the lateness of its wake-up, as its messages carry them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counters {
    /// Number of the message.
    pub(super) seq: u64,
    /// Cycle of the message.
    pub(super) cycle: u64,
    /// When the cycle began, ns.
    pub(super) woke_ns: u64,
    pub(super) skipped: u64,
    pub(super) stalled_ns: u64,
    pub(super) spun_ns: u64,
    pub(super) worked_ns: u64,
    pub(super) overlong_ns: u64,
    /// Wake-up after its deadline, ns.
    pub(super) late_ns: u64,
}

/// Readings and states carry the same account.
macro_rules! counters_from {
    ($($message:ty),*) => {$(
        impl From<&$message> for Counters {
            fn from(message: &$message) -> Self {
                Self {
                    seq: message.seq,
                    cycle: message.cycle,
                    woke_ns: message.woke_ns,
                    skipped: message.skipped_cycles,
                    stalled_ns: message.stalled_ns,
                    spun_ns: message.spun_ns,
                    worked_ns: message.worked_ns,
                    overlong_ns: message.overlong_ns,
                    late_ns: message.woke_ns.saturating_sub(message.due_ns),
                }
            }
        }
    )*};
}

counters_from!(Reading, State);

/// Time lost to stalls and to overlong work, ns.
#[derive(Debug, Clone, Copy, Default)]
struct Loss {
    waiting_ns: u64,
    working_ns: u64,
}

impl Loss {
    fn and(self, more: Self) -> Self {
        Self {
            waiting_ns: self.waiting_ns.saturating_add(more.waiting_ns),
            working_ns: self.working_ns.saturating_add(more.working_ns),
        }
    }

    /// The part of it that can have made a wake-up so late. Stalls come first, since the recording
    /// does not show the share of either.
    fn carried_over(self, late_ns: u64) -> Self {
        let waiting_ns = self.waiting_ns.min(late_ns);
        Self { waiting_ns, working_ns: self.working_ns.min(late_ns - waiting_ns) }
    }

    /// How many of the skipped deadlines it explains: while waiting, and while working. The greater loss explains
    /// first, and a skip that only both losses together explain counts as work.
    fn explains(self, skipped: u64, period_ns: u64) -> (u64, u64) {
        let periods = |lost_ns: u64| lost_ns / period_ns;
        let all = periods(self.waiting_ns.saturating_add(self.working_ns));
        let by_waiting = periods(self.waiting_ns);
        let explained = skipped.min(all);
        if self.waiting_ns >= self.working_ns {
            let waiting = explained.min(by_waiting);
            (waiting, explained - waiting)
        } else {
            let working = explained.min(all - by_waiting);
            (explained - working, working)
        }
    }
}

/// A stretch of work: its cycle, and the wake-ups before and behind it, ns.
#[derive(Debug, Clone, Copy, Default)]
struct Work {
    cycle: u64,
    from_ns: u64,
    to_ns: u64,
}

/// Follows the counters of one process.
#[derive(Debug, Clone, Default)]
pub(super) struct Skips {
    pub(super) figures: SkipFigures,
    /// What the kernel counted of the loop's thread.
    pub(super) samples: LoopSamples,
    /// The stretches of work that cost a deadline and were sampled.
    pub(super) overruns: Vec<Overrun>,
    last_seq: u64,
    /// The cycle of the last message, with its work.
    last_work: Work,
    /// The last overlong stretch of work.
    overlong_work: Work,
    /// Loss that made the last wake-up late: its deadlines are skipped after the late cycle, not before.
    carried_over: Loss,
    /// The stretch of work that is part of it, ns.
    carried_over_stretch_ns: u64,
    /// Each stall of the machine.
    stalls: Durations,
    /// Each overlong stretch of work.
    overlong: Durations,
    /// The shortest overlong stretch of work that cost a deadline and has no certain cause, ns.
    pub(super) shortest_costly_ns: Option<u64>,
}

impl Skips {
    /// The process' counters in its next message. Returns how many deadlines were skipped just before its wake-up; none
    /// where messages before it are missing, since which wake-up skipped them is not known. A fault of the scenario may
    /// have stalled the process before: what it lost is no evidence then.
    pub(super) fn account(&mut self, counters: &Counters, period_ns: u64, is_of_scenario: bool) -> u64 {
        let past = self.figures;
        let stall_ns = counters.stalled_ns.saturating_sub(past.stalled_ns);
        let overlong_ns = counters.overlong_ns.saturating_sub(past.overlong_ns);
        let skipped = counters.skipped.saturating_sub(past.skipped);
        let lost = self.carried_over.and(Loss { waiting_ns: stall_ns, working_ns: overlong_ns });
        let work = Work { to_ns: counters.woke_ns, ..self.last_work };
        self.last_work = Work { cycle: counters.cycle, from_ns: counters.woke_ns, to_ns: counters.woke_ns };
        if overlong_ns > 0 {
            self.overlong_work = work;
        }
        let is_next = counters.seq == std::mem::replace(&mut self.last_seq, counters.seq).wrapping_add(1);
        // Before its first wait a process keeps no account of what held it up.
        let known = if is_next && counters.seq > 1 { skipped } else { 0 };
        self.figures = SkipFigures {
            skipped: counters.skipped,
            stalled_ns: counters.stalled_ns,
            spun_ns: counters.spun_ns,
            worked_ns: counters.worked_ns,
            overlong_ns: counters.overlong_ns,
            ..past
        };
        if is_of_scenario {
            self.figures.by_scenario += skipped;
            (self.carried_over, self.carried_over_stretch_ns) = (Loss::default(), 0);
            return known;
        }
        let (by_machine, while_working) = lost.explains(known, period_ns);
        self.figures.by_machine += by_machine;
        self.figures.while_working += while_working;
        self.figures.unknown_cause += skipped - known;
        let stretch_ns = overlong_ns.max(self.carried_over_stretch_ns);
        if while_working > 0 {
            self.judge_overrun(stretch_ns, while_working, period_ns);
        }
        for (durations, lost_ns) in [(&mut self.stalls, stall_ns), (&mut self.overlong, overlong_ns)] {
            if is_next && lost_ns > 0 {
                durations.record(lost_ns, 1);
            }
        }
        self.carried_over = lost.carried_over(counters.late_ns);
        self.carried_over_stretch_ns = if self.carried_over.working_ns > 0 { stretch_ns } else { 0 };
        known
    }

    /// Notes a stretch of work that cost deadlines.
    fn judge_overrun(&mut self, lasted_ns: u64, skipped: u64, period_ns: u64) {
        let Work { cycle, from_ns, to_ns } = self.overlong_work;
        let LoopSamples { process, cpu_share, .. } = self.samples;
        let overrun = self.samples.around(from_ns, to_ns).map(|counts| {
            let cause = counts.cause(lasted_ns, period_ns, cpu_share);
            Overrun { process, cycle, lasted_ns, skipped, cause, counts }
        });
        if overrun.is_none_or(|overrun| overrun.cause == OverrunCause::Unknown) {
            self.leave_undecided(lasted_ns);
        }
        self.overruns.extend(overrun);
    }

    /// The whole run decides on a stretch of this length.
    fn leave_undecided(&mut self, lasted_ns: u64) {
        let shortest_ns = self.shortest_costly_ns.map_or(lasted_ns, |shortest| shortest.min(lasted_ns));
        self.shortest_costly_ns = Some(shortest_ns);
    }

    /// Counts the deadlines of the overruns by their causes. A machine that also stalls while a loop waits, for half as
    /// long or longer, may have made what counts as CPU time.
    pub(super) fn count_causes(&mut self, longest_stall_ns: u64) {
        for place in 0..self.overruns.len() {
            let Overrun { cause, lasted_ns, skipped, .. } = self.overruns[place];
            match cause {
                OverrunCause::Computed if 2 * longest_stall_ns >= lasted_ns => {
                    self.overruns[place].cause = OverrunCause::Unknown;
                    self.leave_undecided(lasted_ns);
                }
                OverrunCause::Slept | OverrunCause::Computed => self.figures.working_by_loop += skipped,
                OverrunCause::Machine => self.figures.working_by_machine += skipped,
                OverrunCause::Unknown => {}
            }
        }
    }

    /// The longest stall of the machine while the process waited, ns.
    pub(super) fn longest_stall_ns(&self) -> u64 {
        self.stalls.0.max()
    }

    /// Stalls while waiting, and overlong stretches of work, of at least this length.
    pub(super) fn as_long_as(&self, least_ns: u64) -> (u64, u64) {
        let count = |Durations(histogram): &Durations| histogram.count_between(least_ns, u64::MAX);
        (count(&self.stalls), count(&self.overlong))
    }
}

/// Overruns that are told.
const MOST_OVERRUNS: usize = 10;

/// Decides whose fault the overruns of both loops were; returns the longest, those of the loops first.
pub(super) fn longest_overruns(loops: [&mut Skips; 2]) -> Vec<Overrun> {
    let longest_stall_ns = loops.iter().map(|skips| skips.longest_stall_ns()).max().unwrap_or(0);
    let mut overruns = Vec::new();
    for skips in loops {
        skips.count_causes(longest_stall_ns);
        overruns.append(&mut skips.overruns);
    }
    overruns.sort_by_key(|overrun| Reverse((overrun.cause.rank(), overrun.lasted_ns)));
    overruns.truncate(MOST_OVERRUNS);
    overruns
}

/// Least probability at which the machine may be the cause.
const LEAST_CHANCE: f64 = 0.01;

/// The overlong stretches of work of a run, beside the stalls of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[doc(alias("root cause", "binomial test"))]
pub struct OverrunAttribution {
    /// Stretches of work at least as long as the shortest that cost a deadline and has no certain cause.
    pub while_working: u64,
    /// Stalls of that length while waiting.
    pub while_waiting: u64,
    /// Share of work in the running time, without the stalls.
    pub work_share: f64,
    /// Probability that chance puts so many of both into work.
    pub chance: f64,
}

impl OverrunAttribution {
    /// Counts the processes of a run together, since they share the machine. None if no stretch of work without a certain cause
    /// cost a deadline.
    pub(super) fn new(processes: &[&Skips]) -> Option<Self> {
        let least_ns = processes.iter().filter_map(|skips| skips.shortest_costly_ns).min()?;
        let counts = processes.iter().map(|skips| skips.as_long_as(least_ns));
        let (while_waiting, while_working) =
            counts.fold((0, 0), |sum, count| (sum.0 + count.0, sum.1 + count.1));
        let sum_ns = |part: fn(&SkipFigures) -> u64| -> u64 {
            processes.iter().map(|skips| part(&skips.figures)).sum()
        };
        let worked_ns = sum_ns(|figures| figures.worked_ns.saturating_sub(figures.overlong_ns));
        let spun_ns = sum_ns(|figures| figures.spun_ns);
        let work_share = worked_ns as f64 / (worked_ns + spun_ns).max(1) as f64;
        let chance = at_least(while_working, while_working + while_waiting, work_share);
        Some(Self { while_working, while_waiting, work_share, chance })
    }

    /// Whether the machine may be the cause. A single stretch is no evidence against the rig: the same work took its
    /// normal time in every other cycle.
    pub fn may_be_the_machine(&self) -> bool {
        self.while_working <= 1 || self.chance >= LEAST_CHANCE
    }
}

/// Probability that at least `hits` of `n` independent events, each of probability `p`, come true.
fn at_least(hits: u64, n: u64, p: f64) -> f64 {
    if hits == 0 || p >= 1.0 {
        return 1.0;
    }
    if p <= 0.0 {
        return 0.0;
    }
    let odds = (p / (1.0 - p)).ln();
    // Logarithm of the probability of exactly i events, from i = 0 on: the powers alone would underflow.
    let mut exactly = n as f64 * (1.0 - p).ln();
    let mut sum = 0.0;
    for i in 0..=n {
        if i >= hits {
            sum += exactly.exp();
        }
        exactly += ((n - i) as f64 / (i + 1) as f64).ln() + odds;
    }
    sum.min(1.0)
}

#[cfg(test)]
mod tests;
