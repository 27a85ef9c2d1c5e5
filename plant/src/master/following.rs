//! The following error of one drive: its position against what the targets sent to it demand.
//!
//! A drive takes a target at the SYNC after it was sent, and reaches it on a straight line within a period, or later by as
//! much as `controller.lead_cycles` says. The demand is known at every SYNC, late ones too. A position between the demands
//! of the last two SYNCs or periods has no error: a target that just misses its SYNC is taken at the next one.

use masseter_shared::config::{MOST_LEAD_CYCLES, Scenario};
use masseter_shared::messages::codes::Cause;

use super::failure::Failure;

/// SYNC and a line of one period, which every drive takes.
const LEAST_LEAD_CYCLES: f64 = 2.0;
/// Jitter of SYNC, in periods.
const JITTER: f64 = 0.1;
/// A drive does not stop at once when its targets do or SYNC is late: it may go on as before for that long, in periods.
const GOING_ON: f64 = 2.0;
/// Demands that are kept: SYNCs may follow each other within half a period.
const KEPT: usize = 2 * MOST_LEAD_CYCLES;

/// The way to the newest target.
#[derive(Debug, Clone, Copy)]
struct Line {
    from_m: f64,
    to_m: f64,
    since_ns: u64,
    /// Sent last.
    target_m: f64,
}

/// The monitor.
#[derive(Debug, Clone)]
pub(super) struct Following {
    limit_m: f64,
    limit_cycles: u32,
    period_ns: f64,
    longest_step_m: f64,
    /// Age of the oldest demand at which the drive may be, in periods.
    accepted_periods: f64,
    /// None while the drive follows no targets.
    line: Option<Line>,
    /// At the last SYNCs, the newest first, each with the time of its SYNC.
    demands: [(u64, f64); KEPT],
    cycles_beyond: u32,
}

impl Following {
    /// The monitor of the drive of an axis, which follows nothing yet.
    pub(super) fn new(scenario: &Scenario, axis: usize) -> Self {
        let lag_cycles = (scenario.controller.lead_cycles - LEAST_LEAD_CYCLES).max(0.0);
        Self {
            limit_m: scenario.can.following_limit_m,
            limit_cycles: scenario.can.following_limit_cycles,
            period_ns: scenario.period_ns() as f64,
            longest_step_m: scenario.drives.of_axis(axis).max_velocity_m_s * scenario.period_s(),
            accepted_periods: lag_cycles + 1.0 + JITTER,
            line: None,
            demands: [(0, 0.0); KEPT],
            cycles_beyond: 0,
        }
    }

    /// A target is sent to a drive that is at `position_m` and follows its targets.
    pub(super) fn follow(&mut self, position_m: f64, target_m: f64) {
        if let Some(line) = &mut self.line {
            line.target_m = target_m;
        } else {
            self.line = Some(Line { from_m: position_m, to_m: position_m, since_ns: 0, target_m });
            (self.demands, self.cycles_beyond) = ([(0, position_m); KEPT], 0);
        }
    }

    /// The drive follows no targets any more.
    pub(super) fn stop(&mut self) {
        self.line = None;
    }

    /// SYNC at `now_ns`: the drive samples its position and takes the target sent last, at its greatest speed at most.
    pub(super) fn synchronise(&mut self, now_ns: u64) {
        let Some(Line { from_m, to_m, since_ns, target_m }) = self.line else { return };
        let share = self.periods(now_ns.saturating_sub(since_ns)).min(1.0);
        self.demands.rotate_right(1);
        self.demands[0] = (now_ns, from_m + (to_m - from_m) * share);
        let step_m = (target_m - to_m).clamp(-self.longest_step_m, self.longest_step_m);
        self.line = Some(Line { from_m: to_m, to_m: to_m + step_m, since_ns: now_ns, target_m });
    }

    /// Takes the position sampled at the last SYNC; returns the failure once too many in a row are beyond the limit.
    pub(super) fn judge(&mut self, position_m: f64) -> Option<Failure> {
        self.line?;
        let error_m = self.error_m(position_m);
        self.cycles_beyond = if error_m > self.limit_m { self.cycles_beyond + 1 } else { 0 };
        (self.cycles_beyond >= self.limit_cycles)
            .then(|| Failure::with(Cause::FollowingError, [error_m, self.limit_m]))
    }

    /// How far a position is from the accepted demands, m.
    fn error_m(&self, position_m: f64) -> f64 {
        let [(now_ns, now_m), (last_ns, last_m), (before_ns, before_m), ..] = self.demands;
        let periods = self.periods(now_ns.saturating_sub(last_ns)).min(GOING_ON);
        let going_on_m =
            last_m + (last_m - before_m) * periods / self.periods(last_ns.saturating_sub(before_ns)).max(1.0);
        let is_accepted =
            |&&(at_ns, _): &&(u64, f64)| self.periods(now_ns.saturating_sub(at_ns)) <= self.accepted_periods;
        let older_m = self.demands[2..].iter().take_while(is_accepted).map(|(_, demand_m)| *demand_m);
        let accepted_m = [now_m, last_m, going_on_m].into_iter().chain(older_m);
        let ends_m = [f64::INFINITY, -f64::INFINITY];
        let [low_m, high_m] = accepted_m.fold(ends_m, |[low, high], m| [low.min(m), high.max(m)]);
        (low_m - position_m).max(position_m - high_m)
    }

    fn periods(&self, duration_ns: u64) -> f64 {
        duration_ns as f64 / self.period_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const START_M: f64 = 0.27;
    /// The fastest step of the default motion.
    const STEP_M: f64 = 0.116e-3;

    /// A master and a drive that is where its targets take it.
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
            let drive = Line { from_m: START_M, to_m: START_M, since_ns: 0, target_m: START_M };
            let monitor = Following::new(&scenario, 3);
            Self { monitor, now_ns: 0, sent_m: START_M, received_m: None, drive }
        }

        /// SYNC so long after the last; the position that the drive samples.
        fn sync(&mut self, interval_ns: u64) -> f64 {
            self.now_ns += interval_ns;
            self.monitor.synchronise(self.now_ns);
            let Line { from_m, to_m, since_ns, .. } = self.drive;
            let share = ((self.now_ns - since_ns) as f64 / MS as f64).min(1.0);
            if let Some(target_m) = self.received_m.take() {
                self.drive = Line { from_m: to_m, to_m: target_m, since_ns: self.now_ns, target_m };
            }
            from_m + (to_m - from_m) * share
        }

        /// Sends the next target; the drive may miss it.
        fn send(&mut self, position_m: f64, is_lost: bool) {
            self.sent_m += STEP_M;
            self.monitor.follow(position_m, self.sent_m);
            if !is_lost {
                self.received_m = Some(self.sent_m);
            }
        }

        fn cycle(&mut self, interval_ns: u64, is_lost: bool) -> Option<Failure> {
            let position_m = self.sync(interval_ns);
            let failure = self.monitor.judge(position_m);
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

    #[test]
    fn one_lost_target_is_borne_and_the_second_is_noticed() {
        let mut bench = Bench::new(|_| {});
        bench.run();
        assert_eq!(bench.cycle(MS, true), None);
        bench.run();
        // Sent in cycles 0 and 1, demanded in 2 and 3.
        assert_eq!(bench.cycles_until_failure(), Some(3));
        let position_m = bench.sync(MS);
        let failure = bench.monitor.judge(position_m).unwrap();
        assert_eq!((failure.cause, failure.limit), (Cause::FollowingError, 7.5e-5));
        assert!((failure.value - 2.0 * STEP_M).abs() < 1e-9, "{}", failure.value);
    }

    #[test]
    fn neither_late_nor_early_nor_skipped_syncs_are_a_following_error() {
        for late_ns in [100_000, 500_000, 990_000, 2 * MS, 7 * MS, 100 * MS] {
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
        bench.received_m = None;
        for _ in 0..20 {
            let position_m = bench.sync(MS);
            assert_eq!(bench.monitor.judge(position_m), None);
            bench.send(position_m, true);
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

    #[test]
    fn so_many_in_a_row_must_be_beyond_the_limit() {
        let mut bench = Bench::new(|scenario| scenario.can.following_limit_cycles = 3);
        bench.run();
        assert_eq!(bench.cycles_until_failure(), Some(5));
    }

    #[test]
    fn a_drive_that_follows_nothing_may_be_anywhere() {
        let mut bench = Bench::new(|_| {});
        assert_eq!(bench.monitor.judge(0.0), None, "before the drives are enabled");
        bench.run();
        bench.monitor.stop();
        assert_eq!(bench.monitor.judge(0.0), None);
        bench.monitor.synchronise(bench.now_ns + MS);
        bench.monitor.follow(0.1, 0.1);
        bench.monitor.synchronise(bench.now_ns + 2 * MS);
        assert_eq!(bench.monitor.judge(0.1), None, "the demand begins where the drive is");
        assert!(bench.monitor.judge(START_M).is_some());
    }

    #[test]
    fn a_drive_that_smooths_its_targets_lags_by_the_lead() {
        for (lead_cycles, lag, follows) in
            [(2.0, 1, true), (2.0, 3, false), (4.5, 3, true), (4.5, 6, false), (10.0, 9, true)]
        {
            let mut bench = Bench::new(|scenario| scenario.controller.lead_cycles = lead_cycles);
            let mut failures = 0;
            let mut positions_m = [START_M; 10];
            for _ in 0..50 {
                positions_m.rotate_right(1);
                positions_m[0] = bench.sync(MS);
                failures += usize::from(bench.monitor.judge(positions_m[lag]).is_some());
                bench.send(positions_m[lag], false);
            }
            assert_eq!(failures == 0, follows, "{lead_cycles} cycles, late by {lag}");
        }
    }

    #[test]
    fn a_target_far_away_is_approached_at_the_drives_speed() {
        let mut bench = Bench::new(|_| {});
        bench.monitor.follow(START_M, START_M + 0.01);
        let drive = Scenario::default().drives.leg;
        for cycle in 0..20 {
            bench.now_ns += MS;
            bench.monitor.synchronise(bench.now_ns);
            let way_m = f64::from(cycle) * drive.max_velocity_m_s * 1e-3;
            assert_eq!(bench.monitor.judge(START_M + way_m), None, "cycle {cycle}");
        }
    }
}
