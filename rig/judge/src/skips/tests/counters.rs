//! Every counter keeps its meaning from the messages to the figures.

use super::*;

/// Every counter with a value of its own; a wake-up may be recorded before its deadline.
#[test]
fn counters_are_those_of_the_messages() {
    let reading = Reading {
        seq: 1,
        skipped_cycles: 2,
        stalled_ns: 3,
        spun_ns: 4,
        worked_ns: 5,
        overlong_ns: 6,
        due_ns: 100,
        woke_ns: 107,
        ..Reading::default()
    };
    let state = State {
        seq: 11,
        skipped_cycles: 12,
        stalled_ns: 13,
        spun_ns: 14,
        worked_ns: 15,
        overlong_ns: 16,
        due_ns: 100,
        woke_ns: 117,
        ..State::default()
    };
    for (first, counters) in [(1, Counters::from(&reading)), (11, Counters::from(&state))] {
        let Counters { seq, skipped, stalled_ns, spun_ns, worked_ns, overlong_ns, late_ns, .. } = counters;
        let found = [seq, skipped, stalled_ns, spun_ns, worked_ns, overlong_ns, late_ns];
        assert_eq!(found, std::array::from_fn(|place| first + place as u64));
        let mut skips = Skips::default();
        skips.account(&counters, PERIOD_NS, false);
        let figures = skips.figures;
        let found =
            [figures.skipped, figures.stalled_ns, figures.spun_ns, figures.worked_ns, figures.overlong_ns];
        assert_eq!(found, std::array::from_fn(|place| first + 1 + place as u64));
    }
    let early =
        [Counters::from(&Reading { woke_ns: 0, ..reading }), Counters::from(&State { woke_ns: 0, ..state })];
    assert!(early.iter().all(|counters| counters.late_ns == 0));
}

/// Skips of messages in a row, and behind a gap, add up each on its own.
#[test]
fn every_skip_is_counted_once() {
    let mut skips = Skips::default();
    // Number, and what has been counted until then: skipped, stalled, overlong.
    let messages = [
        (1, 0, 0, 0),
        (2, 1, PERIOD_NS, 0),
        (3, 3, 3 * PERIOD_NS, 0),
        (4, 6, 3 * PERIOD_NS, 3 * PERIOD_NS),
        (5, 10, 3 * PERIOD_NS, 7 * PERIOD_NS),
        (7, 15, 3 * PERIOD_NS, 7 * PERIOD_NS),
        (9, 21, 3 * PERIOD_NS, 7 * PERIOD_NS),
    ];
    for (seq, skipped, stalled_ns, overlong_ns) in messages {
        let counters = Counters { seq, skipped, stalled_ns, overlong_ns, ..Counters::default() };
        skips.account(&counters, PERIOD_NS, false);
    }
    let figures = skips.figures;
    let by_cause = [figures.by_machine, figures.while_working, figures.unknown_cause];
    assert_eq!((figures.skipped, by_cause), (21, [3, 7, 11]));
}
