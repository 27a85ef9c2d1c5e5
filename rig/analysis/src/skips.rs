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
use masseter_shared::messages::{Reading, State};
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
mod tests {
    mod counters;

    use proptest::prelude::*;

    use super::*;

    const PERIOD_NS: u64 = 1_000_000;

    /// `[skipped, stalled_ns, overlong_ns, late_ns]` message by message.
    type Messages<'a> = &'a [[u64; 4]];

    fn skips_of(messages: Messages) -> Skips {
        let mut skips = Skips::default();
        for (seq, &[skipped, stalled_ns, overlong_ns, late_ns]) in (1..).zip(messages) {
            let counters = Counters { seq, skipped, stalled_ns, overlong_ns, late_ns, ..Counters::default() };
            skips.take(&counters, PERIOD_NS, false);
        }
        skips
    }

    #[test]
    fn each_skip_has_one_cause() {
        const STALL: u64 = 8_600_000;
        const MORE: u64 = STALL + 3_000_000;
        // What is counted message by message; skips by the machine, while working, and all.
        let cases: [(Messages, [u64; 3]); 14] = [
            (&[[0, 0, 0, 0], [0, 0, 0, 0]], [0, 0, 0]),
            // Woken 8.6 ms late; the passed deadlines are skipped after the late cycle.
            (&[[0, 0, 0, 0], [0, STALL, 0, STALL], [7, STALL, 0, 100]], [7, 0, 7]),
            // A stretch of work of 8.6 ms.
            (&[[0, 0, 0, 0], [8, 0, STALL, 0]], [0, 8, 8]),
            // No time lost at all: the rig's own.
            (&[[0, 0, 0, 0], [3, 0, 0, 0]], [0, 0, 3]),
            // More skipped than the time lost explains.
            (&[[0, 0, 0, 0], [20, STALL, 0, 0]], [8, 0, 20]),
            // The greater loss explains first.
            (&[[0, 0, 0, 0], [8, 60_000, STALL, 0]], [0, 8, 8]),
            (&[[0, 0, 0, 0], [2, 2_500_000, 3_500_000, 0]], [0, 2, 2]),
            (&[[0, 0, 0, 0], [2, 3_500_000, 2_500_000, 0]], [2, 0, 2]),
            // Neither alone explains it.
            (&[[0, 0, 0, 0], [1, 700_000, 600_000, 0]], [0, 1, 1]),
            // One loss explains its skips once, also when more are skipped a cycle later.
            (&[[0, 0, 0, 0], [3, 3_000_000, 0, 900_000], [6, 3_000_000, 0, 0]], [3, 0, 6]),
            (&[[0, 0, 0, 0], [3, 0, 3_000_000, 900_000], [6, 0, 3_000_000, 0]], [0, 3, 6]),
            // A carried-over loss explains a later skip, and a new loss its own.
            (&[[0, STALL, 0, STALL], [8, MORE, 0, 3_000_000], [11, MORE, 0, 0]], [11, 0, 11]),
            // As late as both losses together, but not by all of the work.
            (&[[0, 1_000_000, 3_000_000, 2_000_000], [4, 1_000_000, 3_000_000, 0]], [1, 1, 4]),
            // Time that a wake-up in time had made up for explains nothing.
            (&[[0, STALL, STALL, 0], [2, STALL, STALL, 0]], [0, 0, 2]),
        ];
        for (messages, expected) in cases {
            let figures = skips_of(messages).figures;
            let found = [figures.by_machine, figures.while_working, figures.skipped];
            assert_eq!(found, expected, "{messages:?}");
        }
    }

    #[test]
    fn deadlines_that_passed_before_the_first_wait_have_an_unknown_cause() {
        let figures = skips_of(&[[50, 0, 0, 0], [52, 2_000_000, 0, 0]]).figures;
        assert_eq!([figures.unknown_cause, figures.by_machine, figures.skipped], [50, 2, 52]);
    }

    /// A process that skips as the real-time loop does, and its account.
    #[derive(Default)]
    struct Process {
        now_ns: u64,
        cycle: u64,
        counters: Counters,
        skips: Skips,
    }

    impl Process {
        /// In its first wait.
        fn started() -> Self {
            let mut process = Self::default();
            process.cycle(0, 0, 0);
            process
        }

        /// Works and waits so long after a wake-up, is held up meanwhile, and if it came back in time once more while it
        /// waits for its deadline.
        fn cycle(&mut self, own_ns: u64, held_up_ns: u64, held_up_waiting_ns: u64) {
            self.now_ns += own_ns + held_up_ns;
            self.counters.stalled_ns += held_up_ns;
            self.cycle += 1;
            let missed = self.now_ns.saturating_sub(self.cycle * PERIOD_NS) / PERIOD_NS;
            self.counters.skipped += missed;
            self.cycle += missed;
            let due_ns = self.cycle * PERIOD_NS;
            if self.now_ns < due_ns {
                self.now_ns = due_ns + held_up_waiting_ns;
                self.counters.stalled_ns += held_up_waiting_ns;
            }
            self.counters.late_ns = self.now_ns - due_ns;
            self.counters.seq += 1;
            self.skips.take(&self.counters, PERIOD_NS, false);
        }
    }

    #[test]
    fn a_moment_withheld_in_every_cycle_excuses_no_skip() {
        let mut process = Process::default();
        for cycle in 1..=1000 {
            let own_ns = if cycle % 50 == 0 { 22 * PERIOD_NS / 10 } else { 9 * PERIOD_NS / 10 };
            process.cycle(own_ns, 1000, 1000);
        }
        let figures = process.skips.figures;
        assert_eq!((figures.by_machine, figures.while_working, figures.skipped), (0, 0, 20));
    }

    #[test]
    fn stalls_of_whole_periods_explain_what_they_skip() {
        for periods in [1, 2, 5] {
            for [held_up, waiting] in [[periods, 0], [0, periods]] {
                let mut process = Process::started();
                let own_ns = if held_up > 0 { PERIOD_NS } else { PERIOD_NS / 2 };
                process.cycle(own_ns, held_up * PERIOD_NS, waiting * PERIOD_NS);
                process.cycle(PERIOD_NS, 0, 0);
                process.cycle(PERIOD_NS, 0, 0);
                let figures = process.skips.figures;
                assert_eq!((figures.by_machine, figures.skipped), (periods, periods), "{held_up} {waiting}");
            }
        }
    }

    proptest! {
        #[test]
        fn a_process_that_keeps_its_time_has_every_skip_explained(
            cycles in proptest::collection::vec((0..=PERIOD_NS, 0..3 * PERIOD_NS, 0..3 * PERIOD_NS), 1..100)
        ) {
            let mut process = Process::started();
            for (own_ns, held_up_ns, waiting_ns) in cycles {
                process.cycle(own_ns, held_up_ns, waiting_ns);
            }
            let figures = process.skips.figures;
            prop_assert_eq!(figures.by_machine, figures.skipped);
        }
    }

    #[test]
    fn skips_belong_to_a_wake_up_only_if_the_message_before_it_is_known() {
        let skipped_before = |seq| {
            let mut skips = Skips::default();
            skips.take(&Counters { seq: 1, ..Counters::default() }, PERIOD_NS, false);
            skips.take(&Counters { seq, skipped: 3, ..Counters::default() }, PERIOD_NS, false)
        };
        assert_eq!((skipped_before(2), skipped_before(3)), (3, 0));
    }

    #[test]
    fn what_happened_behind_missing_messages_has_no_known_cause() {
        let mut process = Process::started();
        process.counters.seq += 1;
        process.cycle(0, 5 * PERIOD_NS, 0);
        assert_eq!(process.skips.as_long_as(1), (0, 0));
        process.cycle(0, 5 * PERIOD_NS, 0);
        let figures = process.skips.figures;
        assert_eq!((figures.skipped, figures.by_machine, figures.unknown_cause), (8, 4, 4));
        assert_eq!(process.skips.as_long_as(1), (1, 0));
    }

    #[test]
    fn what_the_scenario_stalls_is_no_skip_of_machine_or_rig() {
        let mut skips = Skips::default();
        let stalls = [
            (1, 0, 0, false),
            (2, 0, 60_000_000, true),
            (3, 60, 60_000_000, true),
            (4, 61, 61_000_000, false),
        ];
        for (seq, skipped, stalled_ns, is_of_scenario) in stalls {
            let counters = Counters { seq, skipped, stalled_ns, ..Counters::default() };
            skips.take(&counters, PERIOD_NS, is_of_scenario);
        }
        let figures = skips.figures;
        assert_eq!((figures.skipped, figures.by_scenario, figures.by_machine), (61, 60, 1));
        assert_eq!(skips.as_long_as(1), (1, 0));
    }

    #[test]
    fn stretches_are_counted_from_the_shortest_that_cost_a_deadline() {
        let skips =
            skips_of(&[[0, 60_000, 70_000, 0], [1, 60_000, 2_070_000, 0], [5, 4_060_000, 7_070_000, 0]]);
        assert_eq!(skips.shortest_costly_ns, Some(2_000_000));
        assert_eq!(skips.as_long_as(2_000_000), (1, 2));
        assert_eq!([0, 1].map(|least_ns| skips.as_long_as(least_ns)), [(2, 3); 2]);
        // A stretch that a wake-up in time made up for is none of the next.
        let skips = skips_of(&[[0, 0, 5_000_000, 0], [2, 0, 7_000_000, 0]]);
        assert_eq!(skips.shortest_costly_ns, Some(2_000_000));
        // What is left of a stretch is not a shorter one.
        let skips = skips_of(&[[0, 0, 5_000_000, 2_000_000], [2, 0, 5_000_000, 0]]);
        assert_eq!(skips.shortest_costly_ns, Some(5_000_000));
    }
}
