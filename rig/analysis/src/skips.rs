//! Skipped deadlines, and what the time before them went to.
//!
//! The machine caused a skip that stalls while the process waited explain. A skip that only an overlong stretch of work
//! explains may have either cause: [`OverrunAttribution`](crate::OverrunAttribution) weighs those of the whole run. The
//! rig caused all others.
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

use hdrhistogram::Histogram;
use masseter_runtime::messages::{Reading, State};
use serde::Serialize;

use super::measured::histogram;

/// Skipped deadlines of one process, and the account of its time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SkipFigures {
    /// Deadlines skipped.
    pub skipped: u64,
    /// Those before which the machine stalled for whole periods while the process waited.
    pub by_machine: u64,
    /// Those before which a stretch of work took too long.
    pub while_working: u64,
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

/// Counters of a process since its start, and the lateness of its wake-up, as its messages carry them.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counters {
    /// Number of the message.
    pub(super) seq: u64,
    pub(super) skipped: u64,
    pub(super) stalled_ns: u64,
    pub(super) spun_ns: u64,
    pub(super) worked_ns: u64,
    pub(super) overlong_ns: u64,
    /// Wake-up after its deadline, ns.
    pub(super) late_ns: u64,
}

impl From<&Reading> for Counters {
    fn from(reading: &Reading) -> Self {
        Self {
            seq: reading.seq,
            skipped: reading.skipped_cycles,
            stalled_ns: reading.stalled_ns,
            spun_ns: reading.spun_ns,
            worked_ns: reading.worked_ns,
            overlong_ns: reading.overlong_ns,
            late_ns: reading.woke_ns.saturating_sub(reading.due_ns),
        }
    }
}

impl From<&State> for Counters {
    fn from(state: &State) -> Self {
        Self {
            seq: state.seq,
            skipped: state.skipped_cycles,
            stalled_ns: state.stalled_ns,
            spun_ns: state.spun_ns,
            worked_ns: state.worked_ns,
            overlong_ns: state.overlong_ns,
            late_ns: state.woke_ns.saturating_sub(state.due_ns),
        }
    }
}

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

/// Follows the counters of one process.
#[derive(Debug, Clone)]
pub(super) struct Skips {
    pub(super) figures: SkipFigures,
    last_seq: u64,
    /// Loss that made the last wake-up late: its deadlines are skipped after the late cycle, not before.
    carried_over: Loss,
    /// The stretch of work that is part of it, ns.
    carried_over_stretch_ns: u64,
    /// Length of each stall of the machine, ns.
    stalls: Histogram<u64>,
    /// Length of each overlong stretch of work, ns.
    overlong: Histogram<u64>,
    /// The shortest overlong stretch of work that cost a deadline, ns.
    pub(super) shortest_costly_ns: Option<u64>,
}

impl Default for Skips {
    fn default() -> Self {
        Self {
            figures: SkipFigures::default(),
            last_seq: 0,
            carried_over: Loss::default(),
            carried_over_stretch_ns: 0,
            stalls: histogram(),
            overlong: histogram(),
            shortest_costly_ns: None,
        }
    }
}

impl Skips {
    /// The process' counters in its next message. Returns how many deadlines were skipped just before its wake-up; none
    /// where messages before it are missing, since which wake-up skipped them is not known. A fault of the scenario may
    /// have stalled the process before: what it lost is no evidence then.
    pub(super) fn take(&mut self, counters: &Counters, period_ns: u64, is_of_scenario: bool) -> u64 {
        let past = self.figures;
        let stall_ns = counters.stalled_ns.saturating_sub(past.stalled_ns);
        let overlong_ns = counters.overlong_ns.saturating_sub(past.overlong_ns);
        let skipped = counters.skipped.saturating_sub(past.skipped);
        let lost = self.carried_over.and(Loss { waiting_ns: stall_ns, working_ns: overlong_ns });
        let is_next = counters.seq == std::mem::replace(&mut self.last_seq, counters.seq).wrapping_add(1);
        // Before its first wait a process keeps no account of what held it up.
        let known = if is_next && counters.seq > 1 { skipped } else { 0 };
        if is_of_scenario {
            return self.take_of_scenario(counters, skipped, known);
        }
        let (by_machine, while_working) = lost.explains(known, period_ns);
        let stretch_ns = overlong_ns.max(self.carried_over_stretch_ns);
        if while_working > 0 {
            self.shortest_costly_ns =
                Some(self.shortest_costly_ns.map_or(stretch_ns, |shortest| shortest.min(stretch_ns)));
        }
        self.figures = SkipFigures {
            skipped: counters.skipped,
            by_machine: past.by_machine + by_machine,
            while_working: past.while_working + while_working,
            unknown_cause: past.unknown_cause + (skipped - known),
            by_scenario: past.by_scenario,
            stalled_ns: counters.stalled_ns,
            spun_ns: counters.spun_ns,
            worked_ns: counters.worked_ns,
            overlong_ns: counters.overlong_ns,
        };
        for (histogram, lost_ns) in [(&mut self.stalls, stall_ns), (&mut self.overlong, overlong_ns)] {
            if is_next && lost_ns > 0 {
                histogram.record(lost_ns).expect("a histogram that resizes itself takes any value");
            }
        }
        self.carried_over = lost.carried_over(counters.late_ns);
        self.carried_over_stretch_ns = if self.carried_over.working_ns > 0 { stretch_ns } else { 0 };
        known
    }

    fn take_of_scenario(&mut self, counters: &Counters, skipped: u64, known: u64) -> u64 {
        self.figures = SkipFigures {
            skipped: counters.skipped,
            by_scenario: self.figures.by_scenario + skipped,
            stalled_ns: counters.stalled_ns,
            spun_ns: counters.spun_ns,
            worked_ns: counters.worked_ns,
            overlong_ns: counters.overlong_ns,
            ..self.figures
        };
        (self.carried_over, self.carried_over_stretch_ns) = (Loss::default(), 0);
        known
    }

    /// Stalls while waiting, and overlong stretches of work, of at least this length.
    pub(super) fn as_long_as(&self, least_ns: u64) -> (u64, u64) {
        let count = |histogram: &Histogram<u64>| histogram.count_between(least_ns, u64::MAX);
        (count(&self.stalls), count(&self.overlong))
    }
}

#[cfg(test)]
mod tests;
