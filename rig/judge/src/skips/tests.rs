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
        skips.account(&counters, PERIOD_NS, false);
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
        self.skips.account(&self.counters, PERIOD_NS, false);
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
        skips.account(&Counters { seq: 1, ..Counters::default() }, PERIOD_NS, false);
        skips.account(&Counters { seq, skipped: 3, ..Counters::default() }, PERIOD_NS, false)
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
    let stalls =
        [(1, 0, 0, false), (2, 0, 60_000_000, true), (3, 60, 60_000_000, true), (4, 61, 61_000_000, false)];
    for (seq, skipped, stalled_ns, is_of_scenario) in stalls {
        let counters = Counters { seq, skipped, stalled_ns, ..Counters::default() };
        skips.account(&counters, PERIOD_NS, is_of_scenario);
    }
    let figures = skips.figures;
    assert_eq!((figures.skipped, figures.by_scenario, figures.by_machine), (61, 60, 1));
    assert_eq!(skips.as_long_as(1), (1, 0));
}

#[test]
fn stretches_are_counted_from_the_shortest_that_cost_a_deadline() {
    let skips = skips_of(&[[0, 60_000, 70_000, 0], [1, 60_000, 2_070_000, 0], [5, 4_060_000, 7_070_000, 0]]);
    assert_eq!(skips.shortest_costly_ns, Some(2_000_000));
    assert_eq!(skips.as_long_as(2_000_000), (1, 2));
    assert_eq!([0, 1].map(|least_ns| skips.as_long_as(least_ns)), [(2, 3); 2]);
    // A stretch that a wake-up in time made up for does not count towards the next.
    let skips = skips_of(&[[0, 0, 5_000_000, 0], [2, 0, 7_000_000, 0]]);
    assert_eq!(skips.shortest_costly_ns, Some(2_000_000));
    // What is left of a stretch is not a shorter one.
    let skips = skips_of(&[[0, 0, 5_000_000, 2_000_000], [2, 0, 5_000_000, 0]]);
    assert_eq!(skips.shortest_costly_ns, Some(5_000_000));
}

mod attribution {
    use super::*;
    use crate::skips::Counters;

    const PERIOD_NS: u64 = 1_000_000;
    const STALL_NS: u64 = 3_000_000;

    /// A process of 10,000 cycles that works a tenth of its running time; some cycles bring a stall of the
    /// machine, some a stretch of work of the same length.
    fn process(stalls: impl Fn(u64) -> bool, slow: impl Fn(u64) -> bool) -> Skips {
        let mut skips = Skips::default();
        let mut counters = Counters::default();
        for cycle in 0..10_000 {
            counters.worked_ns += PERIOD_NS / 40;
            counters.spun_ns += 9 * PERIOD_NS / 40;
            if stalls(cycle) {
                counters.stalled_ns += STALL_NS;
                counters.skipped += 2;
            }
            if slow(cycle) {
                counters.overlong_ns += STALL_NS;
                counters.worked_ns += STALL_NS;
                counters.skipped += 2;
            }
            counters.seq += 1;
            skips.account(&counters, PERIOD_NS, false);
        }
        skips
    }

    #[test]
    fn a_rig_that_is_too_slow_is_distinguished_from_a_machine_that_stalls() {
        // Every how many cycles the machine stalls while waiting, and work takes too long; whether the
        // machine may have done the latter.
        let cases = [
            ("one stretch, machine quiet", 0, 9_000, true),
            ("one in ten stalls hits work", 500, 4_000, true),
            ("stalls hit work twice as often as they should", 500, 2_000, true),
            ("a slow cycle a second, machine quiet", 0, 1_000, false),
            ("a slow cycle a second, machine restless", 1_000, 999, false),
            ("always slow", 0, 1, false),
            ("always slow, machine restless", 100, 2, false),
        ];
        for (name, stall_every, slow_every, expected) in cases {
            let stalls = |cycle: u64| stall_every > 0 && cycle % stall_every == 7;
            let slow = |cycle: u64| cycle % slow_every == slow_every - 1;
            let attribution = OverrunAttribution::new(&[&process(stalls, slow)]).unwrap();
            assert_eq!(attribution.may_be_the_machine(), expected, "{name}: {attribution:?}");
        }
    }

    #[test]
    fn stalls_seen_by_either_process_speak_for_the_machine() {
        let slow_thrice = process(|_| false, |cycle| cycle % 3_000 == 2_999);
        assert!(!OverrunAttribution::new(&[&slow_thrice]).unwrap().may_be_the_machine());
        let restless = process(|cycle| cycle % 500 == 7, |_| false);
        assert!(OverrunAttribution::new(&[&slow_thrice, &restless]).unwrap().may_be_the_machine());
    }

    #[test]
    fn without_a_costly_stretch_there_is_nothing_to_attribute() {
        assert_eq!(OverrunAttribution::new(&[&process(|cycle| cycle % 100 == 3, |_| false)]), None);
    }

    #[test]
    fn chances_are_those_of_the_binomial_distribution() {
        let cases = [
            (0, 5, 0.3, 1.0),
            (1, 1, 0.03, 0.03),
            (2, 3, 0.5, 0.5),
            (2, 2, 0.1, 0.01),
            (5, 5, 0.0, 0.0),
            (3, 5, 1.0, 1.0),
            (1, 10, 0.1, 1.0 - 0.9_f64.powi(10)),
        ];
        for (hits, n, p, expected) in cases {
            assert!((at_least(hits, n, p) - expected).abs() < 1e-12, "{hits} of {n} at {p}");
        }
        assert!(at_least(100_000, 100_000, 0.3) < 1e-100);
        assert!((at_least(30_000, 100_000, 0.3) - 0.5).abs() < 0.01);
    }
}

mod causes {
    use std::collections::BTreeMap;

    use masseter_recording::{LoopInterval, RunUsage};

    use super::*;

    const STRETCH_NS: u64 = 100 * PERIOD_NS;

    /// A loop that works 100 ms in cycle 50 and then skips 99 deadlines. `interval`: each sample of 10 ms around.
    fn loop_with(interval: Option<LoopInterval>, stall_ns: u64) -> Skips {
        let from_ns = |place: u64| 40 * PERIOD_NS + place * 10 * PERIOD_NS;
        let intervals = interval.map(|interval| {
            let at = |place| LoopInterval { from_ns: from_ns(place), to_ns: from_ns(place + 1), ..interval };
            (0..15).map(at).collect::<Vec<_>>()
        });
        let loops: BTreeMap<_, _> = intervals.into_iter().map(|all| ("controller".to_owned(), all)).collect();
        let usage = RunUsage { loops, ..RunUsage::default() };
        let samples = LoopSamples::of(&usage, "controller");
        let mut skips = Skips { samples, ..Skips::default() };
        for cycle in 1..=50 {
            let stalled_ns = if cycle > 1 { stall_ns } else { 0 };
            let woke_ns = cycle * PERIOD_NS;
            let counters = Counters { seq: cycle, cycle, woke_ns, stalled_ns, ..Counters::default() };
            skips.account(&counters, PERIOD_NS, false);
        }
        let late = Counters {
            seq: 51,
            cycle: 150,
            woke_ns: 150 * PERIOD_NS,
            stalled_ns: stall_ns,
            ..Counters::default()
        };
        skips.account(&Counters { skipped: 99, overlong_ns: STRETCH_NS, ..late }, PERIOD_NS, false);
        skips
    }

    #[expect(clippy::unnecessary_wraps, reason = "it takes the place of a search")]
    fn interval(cpu_ns: u64, queued_ns: u64) -> Option<LoopInterval> {
        let (cpu_ns, queued_ns, stolen_ns) = (Some(cpu_ns), Some(queued_ns), Some(0));
        Some(LoopInterval { cpu_ns, queued_ns, stolen_ns, voluntary_switches: 1, ..LoopInterval::default() })
    }

    #[test]
    fn the_samples_around_a_stretch_of_work_name_its_cause() {
        const MS: u64 = PERIOD_NS;
        let cases = [
            (interval(MS, 0), 0, OverrunCause::Slept, [99, 0, 0]),
            (interval(10 * MS, 0), 0, OverrunCause::Computed, [99, 0, 0]),
            (interval(10 * MS, 0), 30 * MS, OverrunCause::Computed, [99, 0, 0]),
            // The machine stalls for as long where CPU time cannot be the reason.
            (interval(10 * MS, 0), 80 * MS, OverrunCause::Unknown, [0, 0, 99]),
            (interval(MS, 9 * MS), 0, OverrunCause::Machine, [0, 99, 0]),
        ];
        for (interval, stall_ns, cause, expected) in cases {
            let mut skips = loop_with(interval, stall_ns);
            let overruns = longest_overruns([&mut skips, &mut Skips::default()]);
            let figures = skips.figures;
            let found = [figures.working_by_loop, figures.working_by_machine, figures.working_undecided()];
            assert_eq!(found, expected, "{cause:?}");
            assert_eq!(overruns.len(), 1);
            let Overrun { process, cycle, lasted_ns, skipped, cause: found, .. } = overruns[0];
            assert_eq!((process, cycle, lasted_ns, skipped), ("controller", 50, STRETCH_NS, 99));
            assert_eq!(found, cause);
            let is_decided = cause != OverrunCause::Unknown;
            assert_eq!(OverrunAttribution::new(&[&skips]).is_none(), is_decided);
        }
    }

    #[test]
    fn without_samples_the_whole_run_decides() {
        let mut skips = loop_with(None, 0);
        assert_eq!(longest_overruns([&mut skips, &mut Skips::default()]), []);
        assert_eq!((skips.figures.while_working, skips.figures.working_undecided()), (99, 99));
        assert!(OverrunAttribution::new(&[&skips]).is_some());
    }
}
