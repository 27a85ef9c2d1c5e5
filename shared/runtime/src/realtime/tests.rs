use std::iter::repeat_n;
use std::time::Duration;

use proptest::prelude::*;

use super::*;
use crate::clock::SECOND_NS;

const PERIOD_NS: u64 = 1_000_000;
const STALL: Duration = Duration::from_millis(2);
const STALL_NS: u64 = 2_000_000;

#[test]
fn deadlines_in_time_are_taken_one_by_one() {
    let mut cycle = Cycle::new(10 * PERIOD_NS, PERIOD_NS);
    assert_eq!(cycle.claim_deadline(0), 1);
    assert_eq!(cycle.claim_deadline(10 * PERIOD_NS + 300), 2);
    assert_eq!(cycle.due_ns(2), 11 * PERIOD_NS);
    assert_eq!(cycle.skipped, 0);
}

#[test]
fn a_late_cycle_starts_late_but_is_not_skipped_within_its_period() {
    let mut cycle = Cycle::new(10 * PERIOD_NS, PERIOD_NS);
    cycle.claim_deadline(0);
    assert_eq!(cycle.claim_deadline(11 * PERIOD_NS + PERIOD_NS - 1), 2);
    assert_eq!(cycle.skipped, 0);
}

#[test]
fn passed_deadlines_are_skipped_counted_and_never_caught_up() {
    let mut cycle = Cycle::new(10 * PERIOD_NS, PERIOD_NS);
    cycle.claim_deadline(0);
    assert_eq!(cycle.claim_deadline(15 * PERIOD_NS + 7), 6);
    assert_eq!(cycle.skipped, 4);
    assert_eq!(cycle.claim_deadline(15 * PERIOD_NS + 100), 7);
    assert_eq!(cycle.skipped, 4);
}

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
    // A stall of the machine leaves no time for a warm-up, but a stall does not happen each time.
    let calls: Vec<_> = (0..20).map(|_| warmed_up(&mut waiter, 5_000_000)).collect();
    assert!(calls.iter().all(|&calls| calls <= 1) && calls.contains(&1), "{calls:?}");
    assert!(waiter.account().worked_ns > 0);
    let failed = (0..20).any(|_| waiter.until_warm(clock::now_ns() + 5_000_000, || Err("no")) == Err("no"));
    assert!(failed);
}

#[test]
fn a_wait_that_may_end_late_never_returns_early_and_leaves_the_spin_out() {
    let mut waiter = Waiter::new(1_000_000);
    for (ahead_ns, tolerance_ns) in [(0, 0), (20_000, 1_000_000), (2_000_000, 0), (2_000_000, 1_000_000)] {
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
    // A due instant does not block.
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

/// The margin at 1 kHz after sleeps of these latencies, ns.
fn after(latencies: impl IntoIterator<Item = u64>) -> u64 {
    let mut margin = SpinMargin::new(PERIOD_NS);
    latencies.into_iter().for_each(|latency_ns| margin.learn(latency_ns));
    margin.current_ns
}

#[test]
fn the_first_margin_is_the_longest() {
    assert_eq!(SpinMargin::new(PERIOD_NS).current_ns, LONGEST_MARGIN_NS);
    assert_eq!(SpinMargin::new(60_000).current_ns, 20_000);
}

#[test]
fn the_margin_can_be_lengthened_as_far_as_the_period_allows_and_halved_where_a_wait_may_end_late() {
    let mut margin = SpinMargin::new(90_000);
    assert_eq!((margin.current_ns, margin.at_least(50_000), margin.latency_ns()), (30_000, 30_000, 15_000));
    repeat_n(1_000, 100_000).for_each(|latency_ns| margin.learn(latency_ns));
    assert_eq!(margin.at_least(10_000), margin.current_ns.max(10_000));
    assert!(margin.current_ns < 20_000);
}

#[test]
fn a_punctual_machine_gets_a_short_margin() {
    let margin_ns = after(repeat_n(10_000, 40_000));
    assert!((25_000..35_000).contains(&margin_ns), "{margin_ns}");
}

#[test]
fn one_late_sleep_is_remembered_for_thousands_of_cycles() {
    let late =
        |after_it: usize| after(repeat_n(10_000, 40_000).chain([80_000]).chain(repeat_n(10_000, after_it)));
    assert_eq!(late(0), 165_000);
    assert!(late(1000) > 130_000, "{}", late(1000));
    assert!(late(10_000) < 60_000, "{}", late(10_000));
}

#[test]
fn a_stall_that_no_margin_covers_changes_nothing() {
    let punctual = || repeat_n(10_000, 40_000);
    assert_eq!(after(punctual().chain([30_000_000])), after(punctual()));
}

proptest! {
    #[test]
    fn the_margin_keeps_its_bounds(
        period_ns in 50_000_u64..100_000_000,
        latencies in prop::collection::vec(0_u64..1_000_000_000, 0..200),
    ) {
        let mut margin = SpinMargin::new(period_ns);
        for latency_ns in latencies {
            margin.learn(latency_ns);
            prop_assert!((SHORTEST_MARGIN_NS..=LONGEST_MARGIN_NS.min(period_ns / PARTS_OF_PERIOD)).contains(&margin.current_ns));
        }
    }
}
