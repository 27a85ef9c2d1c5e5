//! The monitor beside a drive without inertia.

use super::*;

const MS: u64 = 1_000_000;
const START_M: f64 = 0.27;
const SENDING_NS: u64 = 300_000;
/// The fastest step of the default motion.
const STEP_M: f64 = 0.116e-3;

/// A master, and a drive exactly at its demand.
struct Bench {
    monitor: Following,
    now_ns: u64,
    sent_m: f64,
    received_m: Option<f64>,
    drive: Line,
}

impl Bench {
    fn new(change: impl FnOnce(&mut Scenario)) -> Self {
        let mut scenario = Scenario::default();
        change(&mut scenario);
        let drive = Line { from_m: START_M, to_m: START_M, since_ns: 0, target_m: START_M, sent_ns: 0 };
        let monitor = Following::new(&scenario, 3, SENDING_NS);
        Self { monitor, now_ns: 0, sent_m: START_M, received_m: None, drive }
    }

    /// SYNC this long after the last; returns the drive's sampled position.
    fn sync(&mut self, interval_ns: u64) -> f64 {
        self.now_ns += interval_ns;
        self.monitor.synchronise(self.now_ns);
        let Line { from_m, to_m, since_ns, .. } = self.drive;
        let share = ((self.now_ns - since_ns) as f64 / MS as f64).min(1.0);
        if let Some(target_m) = self.received_m.take() {
            self.drive = Line { from_m: to_m, to_m: target_m, since_ns: self.now_ns, ..self.drive };
        }
        from_m + (to_m - from_m) * share
    }

    /// Sends the next target in the middle of a period; the drive may miss it.
    fn send(&mut self, position_m: f64, is_lost: bool) {
        self.send_after(MS / 2, position_m, is_lost);
    }

    fn send_after(&mut self, delay_ns: u64, position_m: f64, is_lost: bool) {
        self.sent_m += STEP_M;
        self.monitor.follow(self.now_ns + delay_ns, position_m, self.sent_m);
        if !is_lost {
            self.received_m = Some(self.sent_m);
        }
    }

    fn cycle(&mut self, interval_ns: u64, is_lost: bool) -> Option<Failure> {
        let position_m = self.sync(interval_ns);
        let failure = self.monitor.following_failure(position_m);
        self.send(position_m, is_lost);
        failure
    }

    /// Cycles in time until the failure, all targets lost.
    fn cycles_until_failure(&mut self) -> Option<usize> {
        (0..50).position(|_| self.cycle(MS, true).is_some())
    }

    fn run(&mut self) {
        (0..20).for_each(|_| assert_eq!(self.cycle(MS, false), None));
    }
}

/// Limits for a drive without inertia. The emulated drives go on a little, and so tolerate one lost target.
#[test]
fn a_lost_target_is_noticed_when_the_drive_should_be_there() {
    let mut bench = Bench::new(|_| {});
    bench.run();
    // Sent in cycle 0, taken in cycle 1, reached in cycle 2.
    assert_eq!(bench.cycles_until_failure(), Some(2));
    let position_m = bench.sync(MS);
    let failure = bench.monitor.following_failure(position_m).unwrap();
    assert_eq!((failure.cause, failure.limit), (Cause::FollowingError, 7.5e-5));
    assert!((failure.value - 2.0 * STEP_M).abs() < 1e-9, "{}", failure.value);
}

#[test]
fn an_uneven_demand_excuses_an_error_for_some_cycles_only() {
    let mut bench = Bench::new(|_| {});
    bench.run();
    bench.cycle(MS + MS / 2, false);
    assert_eq!(bench.cycles_until_failure(), Some(5), "that of the fourth lost target is too large");
    let mut bench = Bench::new(|_| {});
    bench.run();
    bench.cycle(MS + MS / 2, false);
    bench.run();
    assert_eq!(bench.cycles_until_failure(), Some(2));
}

#[test]
fn a_drive_may_be_unseen_for_a_short_way_only() {
    for (step_m, cycles) in [(0.0, 3), (0.9e-4, 3), (1.1e-4, 2), (1.6e-4, 1), (4e-4, 1)] {
        let mut bench = Bench::new(|_| {});
        bench.monitor.follow(0, START_M, START_M + step_m);
        bench.monitor.synchronise(MS);
        assert_eq!(bench.monitor.may_miss_cycles(3), cycles, "{step_m} m a cycle");
    }
}

#[test]
fn neither_late_nor_early_nor_skipped_syncs_are_a_following_error() {
    for late_ns in [100_000, 500_000, 700_000, 990_000, 2 * MS, 7 * MS, 100 * MS] {
        let mut bench = Bench::new(|scenario| scenario.can.following_limit_m = 1e-9);
        bench.run();
        assert_eq!(bench.cycle(MS + late_ns, false), None);
        assert_eq!(bench.cycle(MS - late_ns.min(990_000), false), None);
        bench.run();
    }
}

/// As behind a late RPDO, which SYNC overtakes.
#[test]
fn targets_that_miss_their_sync_are_none_either() {
    let mut bench = Bench::new(|scenario| scenario.can.following_limit_m = 1e-9);
    bench.run();
    let position_m = bench.sync(MS);
    bench.send_after(MS - SENDING_NS + 1, position_m, true);
    bench.received_m = Some(bench.sent_m - STEP_M);
    for _ in 0..20 {
        let position_m = bench.sync(MS);
        assert_eq!(bench.monitor.following_failure(position_m), None);
        bench.send_after(MS - SENDING_NS + 1, position_m, true);
        bench.received_m = Some(bench.sent_m - STEP_M);
    }
}

#[test]
fn a_missing_position_neither_hides_nor_makes_an_error() {
    let mut bench = Bench::new(|scenario| scenario.can.following_limit_cycles = 2);
    bench.run();
    for _ in 0..3 {
        let position_m = bench.sync(MS);
        bench.send(position_m, false);
    }
    bench.run();
    for _ in 0..4 {
        bench.cycle(MS, true);
    }
    let unseen_m = bench.sync(MS);
    bench.send(unseen_m, true);
    assert!(bench.cycle(MS, true).is_some());
}

/// A drive is late by a time, at every rate.
#[test]
fn at_high_rates_an_uneven_demand_excuses_the_way_of_a_millisecond_and_12_ms() {
    for (rate_hz, steps, syncs) in [(500, 3.0, 12), (1000, 3.0, 12), (20_000, 22.0, 240)] {
        let monitor = Following::new(&Scenario { rate_hz, ..Scenario::default() }, 3, SENDING_NS);
        assert_eq!((monitor.excused_steps, monitor.settling_syncs), (steps, syncs), "{rate_hz} Hz");
    }
}

#[test]
fn so_many_in_a_row_must_be_beyond_the_limit() {
    let mut bench = Bench::new(|scenario| scenario.can.following_limit_m = 0.25);
    bench.monitor.follow(0, 0.5, 0.5);
    assert_eq!(bench.monitor.following_failure(0.75), None, "at the limit");
    let mut bench = Bench::new(|scenario| scenario.can.following_limit_cycles = 3);
    bench.run();
    assert_eq!(bench.cycles_until_failure(), Some(4));
}

#[test]
fn a_drive_that_follows_nothing_may_be_anywhere() {
    let mut bench = Bench::new(|_| {});
    assert_eq!(bench.monitor.following_failure(0.0), None, "before the drives are enabled");
    bench.run();
    bench.monitor.stop();
    assert_eq!(bench.monitor.following_failure(0.0), None);
    bench.monitor.synchronise(bench.now_ns + MS);
    bench.monitor.follow(bench.now_ns + MS, 0.1, 0.1);
    bench.monitor.synchronise(bench.now_ns + 2 * MS);
    assert_eq!(bench.monitor.following_failure(0.1), None, "the demand begins where the drive is");
    assert!(bench.monitor.following_failure(START_M).is_some());
}

#[test]
fn a_drive_that_smooths_its_targets_lags_by_the_lead() {
    for (lead_cycles, interval_ns, lag, follows) in [
        (2.0, MS, 0, true),
        (2.0, MS, 2, false),
        (4.5, MS, 3, true),
        (4.5, MS, 5, false),
        (10.0, MS, 8, true),
        (10.0, MS / 2, 16, true),
    ] {
        let mut bench = Bench::new(|scenario| scenario.controller.lead_cycles = lead_cycles);
        let mut failures = 0;
        let mut positions_m = [START_M; 20];
        for _ in 0..50 {
            positions_m.rotate_right(1);
            positions_m[0] = bench.sync(interval_ns);
            failures += usize::from(bench.monitor.following_failure(positions_m[lag]).is_some());
            bench.send(positions_m[lag], false);
        }
        assert_eq!(failures == 0, follows, "{lead_cycles} cycles, late by {lag}");
    }
}

#[test]
fn a_target_far_away_is_approached_at_the_drives_speed() {
    let mut bench = Bench::new(|_| {});
    bench.monitor.follow(0, START_M, START_M + 0.01);
    let drive = Scenario::default().drives.leg;
    for cycle in 0..20 {
        bench.now_ns += MS;
        bench.monitor.synchronise(bench.now_ns);
        let way_m = f64::from(cycle) * drive.max_velocity_m_s * 1e-3;
        assert_eq!(bench.monitor.following_failure(START_M + way_m), None, "cycle {cycle}");
    }
}
