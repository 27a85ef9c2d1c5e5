//! Skipped deadlines, and what the time before them went to.
//!
//! A skip that time withheld while waiting explains is the machine's. One that only a stretch of work
//! explains which took too long is suspect: [`blame`](super::blame) weighs those of the whole run. Any
//! other is the rig's own.

use hdrhistogram::Histogram;
use masseter_shared::messages::{Reading, State};
use serde::Serialize;

/// Skipped deadlines of one process, and the account of its time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct SkipFigures {
    /// Deadlines skipped.
    pub skipped: u64,
    /// Those before which the machine stood still while the process waited.
    pub by_machine: u64,
    /// Those before which a stretch of work took too long.
    pub while_working: u64,
    /// Time that the machine withheld from the process while it waited, ns.
    pub stalled_ns: u64,
    /// Time that the process spun, what was withheld left out, ns.
    pub spun_ns: u64,
    /// Time that the process worked, ns.
    pub worked_ns: u64,
    /// Part of it in stretches too long for the work alone, ns.
    pub overlong_ns: u64,
}

/// What a process counts since its start, as its messages carry it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Counters {
    pub(super) skipped: u64,
    pub(super) stalled_ns: u64,
    pub(super) spun_ns: u64,
    pub(super) worked_ns: u64,
    pub(super) overlong_ns: u64,
}

impl From<&Reading> for Counters {
    fn from(reading: &Reading) -> Self {
        Self {
            skipped: reading.skipped_cycles,
            stalled_ns: reading.stalled_ns,
            spun_ns: reading.spun_ns,
            worked_ns: reading.worked_ns,
            overlong_ns: reading.overlong_ns,
        }
    }
}

impl From<&State> for Counters {
    fn from(state: &State) -> Self {
        Self {
            skipped: state.skipped_cycles,
            stalled_ns: state.stalled_ns,
            spun_ns: state.spun_ns,
            worked_ns: state.worked_ns,
            overlong_ns: state.overlong_ns,
        }
    }
}

/// A stretch of lost time, and what of it has explained no skip yet, ns.
#[derive(Debug, Clone, Copy, Default)]
struct Loss {
    length_ns: u64,
    unused_ns: u64,
}

impl Loss {
    /// What is left of a stretch when `used_ns` have explained skips, first of the stretch before.
    fn left_of(length_ns: u64, before: Self, used_ns: u64) -> Self {
        let unused_ns = length_ns.min(before.unused_ns.saturating_add(length_ns).saturating_sub(used_ns));
        if unused_ns == 0 { Self::default() } else { Self { length_ns, unused_ns } }
    }
}

/// Follows the counters of one process.
#[derive(Debug)]
pub(super) struct Skips {
    figures: SkipFigures,
    /// Time lost in the cycle before: a late cycle is skipped after, not before, it was run.
    recent_stall: Loss,
    recent_overlong: Loss,
    /// How long the machine stood still at a time, ns.
    stalls: Histogram<u64>,
    /// How long the overlong stretches of work were, ns.
    overlong: Histogram<u64>,
    shortest_costly_ns: Option<u64>,
}

impl Default for Skips {
    fn default() -> Self {
        let histogram = || Histogram::new(3).expect("three digits are allowed");
        Self {
            figures: SkipFigures::default(),
            recent_stall: Loss::default(),
            recent_overlong: Loss::default(),
            stalls: histogram(),
            overlong: histogram(),
            shortest_costly_ns: None,
        }
    }
}

impl Skips {
    /// The process' counters in its next message.
    pub(super) fn take(&mut self, counters: &Counters, period_ns: u64) {
        let past = self.figures;
        let stall_ns = counters.stalled_ns.saturating_sub(past.stalled_ns);
        let overlong_ns = counters.overlong_ns.saturating_sub(past.overlong_ns);
        let skipped = counters.skipped.saturating_sub(past.skipped);
        let lost_waiting_ns = stall_ns.saturating_add(self.recent_stall.unused_ns);
        let lost_working_ns = overlong_ns.saturating_add(self.recent_overlong.unused_ns);
        let (by_machine, while_working) = if lost_waiting_ns >= lost_working_ns {
            explain(skipped, lost_waiting_ns, lost_working_ns, period_ns)
        } else {
            let (while_working, by_machine) = explain(skipped, lost_working_ns, lost_waiting_ns, period_ns);
            (by_machine, while_working)
        };
        if while_working > 0 {
            let costly_ns = overlong_ns.max(self.recent_overlong.length_ns);
            self.shortest_costly_ns =
                Some(self.shortest_costly_ns.map_or(costly_ns, |shortest| shortest.min(costly_ns)));
        }
        self.figures = SkipFigures {
            skipped: counters.skipped,
            by_machine: past.by_machine + by_machine,
            while_working: past.while_working + while_working,
            stalled_ns: counters.stalled_ns,
            spun_ns: counters.spun_ns,
            worked_ns: counters.worked_ns,
            overlong_ns: counters.overlong_ns,
        };
        for (histogram, lost_ns) in [(&mut self.stalls, stall_ns), (&mut self.overlong, overlong_ns)] {
            if lost_ns > 0 {
                histogram.record(lost_ns).expect("a histogram that resizes itself takes any value");
            }
        }
        let used_ns = |skips: u64| skips.saturating_mul(period_ns);
        self.recent_stall = Loss::left_of(stall_ns, self.recent_stall, used_ns(by_machine));
        self.recent_overlong = Loss::left_of(overlong_ns, self.recent_overlong, used_ns(while_working));
    }

    pub(super) fn figures(&self) -> SkipFigures {
        self.figures
    }

    /// The shortest overlong stretch of work that cost a deadline, ns.
    pub(super) fn shortest_costly_ns(&self) -> Option<u64> {
        self.shortest_costly_ns
    }

    /// Stalls while waiting, and overlong stretches of work, of at least this length.
    pub(super) fn as_long_as(&self, least_ns: u64) -> (u64, u64) {
        let count = |histogram: &Histogram<u64>| histogram.count_between(least_ns, u64::MAX);
        (count(&self.stalls), count(&self.overlong))
    }
}

/// How many of the skipped deadlines the greater loss of time explains, and how many of the rest the
/// smaller one.
fn explain(skipped: u64, greater_ns: u64, smaller_ns: u64, period_ns: u64) -> (u64, u64) {
    let by_greater = skipped.min(greater_ns.div_ceil(period_ns));
    (by_greater, (skipped - by_greater).min(smaller_ns.div_ceil(period_ns)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// `(skipped, stalled_ns, overlong_ns)` message by message.
    type Messages<'a> = &'a [(u64, u64, u64)];

    fn skips_of(messages: Messages) -> Skips {
        let mut skips = Skips::default();
        for &(skipped, stalled_ns, overlong_ns) in messages {
            let counters = Counters { skipped, stalled_ns, overlong_ns, ..Counters::default() };
            skips.take(&counters, PERIOD_NS);
        }
        skips
    }

    #[test]
    fn each_skip_has_one_cause() {
        const STALL: u64 = 8_600_000;
        // What is counted message by message; skips by the machine, while working, and all.
        let cases: [(Messages, [u64; 3]); 11] = [
            (&[(0, 0, 0), (0, 0, 0)], [0, 0, 0]),
            // Woken 8.6 ms late; the passed deadlines are skipped after the late cycle.
            (&[(0, 0, 0), (0, STALL, 0), (7, STALL, 0)], [7, 0, 7]),
            // A stretch of work of 8.6 ms.
            (&[(0, 0, 0), (8, 0, STALL)], [0, 8, 8]),
            // No time lost at all: the rig's own.
            (&[(0, 0, 0), (3, 0, 0)], [0, 0, 3]),
            // More skipped than the time lost explains.
            (&[(0, 0, 0), (20, STALL, 0)], [9, 0, 20]),
            // The greater loss explains first.
            (&[(0, 0, 0), (9, 60_000, STALL)], [0, 9, 9]),
            // One loss explains its skips once, also when more are skipped a cycle later.
            (&[(0, 0, 0), (3, 3_000_000, 0), (6, 3_000_000, 0)], [3, 0, 6]),
            (&[(0, 0, 0), (3, 0, 3_000_000), (6, 0, 3_000_000)], [0, 3, 6]),
            // What has explained none yet still may, and what is lost meanwhile is kept for its own.
            (&[(0, 0, 0), (2, STALL, 0), (8, STALL, 0)], [8, 0, 8]),
            (&[(0, STALL, 0), (8, STALL + 3_000_000, 0), (11, STALL + 3_000_000, 0)], [11, 0, 11]),
            // Time lost long ago explains nothing.
            (&[(0, STALL, STALL), (0, STALL, STALL), (0, STALL, STALL), (2, STALL, STALL)], [0, 0, 2]),
        ];
        for (messages, expected) in cases {
            let figures = skips_of(messages).figures();
            let found = [figures.by_machine, figures.while_working, figures.skipped];
            assert_eq!(found, expected, "{messages:?}");
        }
    }

    #[test]
    fn stretches_are_counted_from_the_shortest_that_cost_a_deadline() {
        let skips = skips_of(&[(0, 60_000, 70_000), (1, 60_000, 2_070_000), (5, 4_060_000, 7_070_000)]);
        assert_eq!(skips.shortest_costly_ns(), Some(2_000_000));
        assert_eq!(skips.as_long_as(2_000_000), (1, 2));
        assert_eq!(skips.as_long_as(1), (2, 3));
        // What is left of a stretch is not a shorter one.
        let skips = skips_of(&[(0, 0, 0), (3, 0, 5_000_000), (5, 0, 5_000_000)]);
        assert_eq!(skips.shortest_costly_ns(), Some(5_000_000));
    }
}
