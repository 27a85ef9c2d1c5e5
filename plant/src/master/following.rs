//! The following error of one drive: the distance of its position from where its targets should have taken the drive.
//!
//! A drive takes its newest target at SYNC and reaches the target on a straight line within a period, or later by as much
//! as `controller.lead_cycles` says. So the master knows the demand at every SYNC, when the drive samples its position.
//!
//! A real drive cannot follow a demand that is uneven: SYNC comes early or late or overtakes the target, or the targets
//! stop or start at once. For some cycles after that, the drive may be farther away.

use masseter_shared::config::{MOST_LEAD_CYCLES, Scenario};
use masseter_shared::messages::codes::Cause;

use super::failure::Failure;

/// Periods from a target's command until every drive has reached the target: one until SYNC, one for the line.
const LEAST_LEAD_CYCLES: f64 = 2.0;
/// Deviation of an even SYNC from its time, in periods.
const JITTER: f64 = 0.1;
/// Largest acceleration of an even demand: the default motions take 1.3 m/s², and a drive that stops from such a change at once
/// stays within the following error's limit.
const EVEN_CHANGE_M_S2: f64 = 40.0;
/// Least SYNCs, and least time, until a drive has settled after an uneven demand. The emulated drives' error falls by 12 %
/// a millisecond.
const SETTLING_SYNCS: u32 = 12;
const SETTLING_S: f64 = 0.012;
/// Time by which a drive brakes and accelerates late after an uneven demand, at least a period.
const LATE_S: f64 = 0.001;
/// Way that a drive may miss while its position is unknown, in limits of the following error.
const UNSEEN_LIMITS: f64 = 4.0;
/// Demands that are kept: SYNCs may follow each other within half a period.
const KEPT: usize = 2 * MOST_LEAD_CYCLES;

/// The demand between two SYNCs.
#[derive(Debug, Clone, Copy)]
struct Line {
    from_m: f64,
    to_m: f64,
    /// SYNC, at which the line begins, ns.
    since_ns: u64,
    /// The target sent last, m, and when it was sent, ns.
    target_m: f64,
    sent_ns: u64,
}

/// The demand at a SYNC.
#[derive(Debug, Clone, Copy, Default)]
struct Demand {
    sync_ns: u64,
    position_m: f64,
}

/// The monitor of one drive.
#[derive(Debug, Clone)]
pub(super) struct Following {
    limit_m: f64,
    limit_cycles: u32,
    period_ns: f64,
    /// Time that a target needs to be on the wire before SYNC, ns.
    sending_ns: u64,
    /// Longest step of the demand, by the drive's limit of velocity, m.
    longest_step_m: f64,
    /// Largest change from one step to the next of an even demand, m.
    even_change_m: f64,
    /// Distance that an uneven demand excuses, in steps of that demand: one for a target that SYNC overtook, the others
    /// for the drive, which is late.
    excused_steps: f64,
    settling_syncs: u32,
    /// Time by which the drive lags behind the demand, in periods.
    lag_periods: f64,
    /// None while the drive follows no targets.
    line: Option<Line>,
    /// At the last SYNCs, the newest first.
    demands: [Demand; KEPT],
    /// Distance that uneven demands excuse, m, and for how many SYNCs more.
    excused_m: f64,
    excused_syncs: u32,
    cycles_beyond: u32,
}

impl Line {
    fn step_m(&self) -> f64 {
        self.to_m - self.from_m
    }
}

impl Following {
    /// The monitor of the drive of an axis, which follows nothing yet. A target sent less than `sending_ns` before SYNC
    /// may miss SYNC.
    pub(super) fn new(scenario: &Scenario, axis: usize, sending_ns: u64) -> Self {
        let (drive, period_s) = (scenario.drives.of_axis(axis), scenario.period_s());
        Self {
            limit_m: scenario.can.following_limit_m,
            limit_cycles: scenario.can.following_limit_cycles,
            period_ns: scenario.period_ns() as f64,
            sending_ns,
            longest_step_m: drive.max_velocity_m_s * period_s,
            even_change_m: EVEN_CHANGE_M_S2 * period_s * period_s,
            excused_steps: 1.0 + (LATE_S / period_s).max(1.0),
            settling_syncs: SETTLING_SYNCS.max((SETTLING_S / period_s).ceil() as u32),
            lag_periods: (scenario.controller.lead_cycles - LEAST_LEAD_CYCLES).ceil().max(0.0),
            line: None,
            demands: [Demand::default(); KEPT],
            excused_m: 0.0,
            excused_syncs: 0,
            cycles_beyond: 0,
        }
    }

    /// A target is sent to a drive that is at `position_m` and follows its targets.
    pub(super) fn follow(&mut self, now_ns: u64, position_m: f64, target_m: f64) {
        let standing =
            Line { from_m: position_m, to_m: position_m, since_ns: now_ns, target_m, sent_ns: now_ns };
        if self.line.is_none() {
            self.demands = [Demand { sync_ns: 0, position_m }; KEPT];
            (self.excused_m, self.excused_syncs, self.cycles_beyond) = (0.0, 0, 0);
        }
        let line = self.line.get_or_insert(standing);
        (line.target_m, line.sent_ns) = (target_m, now_ns);
    }

    /// The drive follows no targets any more.
    pub(super) fn stop(&mut self) {
        self.line = None;
    }

    /// SYNC at `now_ns`: the drive samples its position and takes the target sent last, at its greatest speed at most.
    pub(super) fn synchronise(&mut self, now_ns: u64) {
        let Some(line) = self.line else { return };
        let interval = self.periods(now_ns.saturating_sub(line.since_ns));
        self.demands.rotate_right(1);
        let position_m = line.from_m + line.step_m() * interval.min(1.0);
        self.demands[0] = Demand { sync_ns: now_ns, position_m };
        let step_m = (line.target_m - line.to_m).clamp(-self.longest_step_m, self.longest_step_m);
        let next = Line { from_m: line.to_m, to_m: line.to_m + step_m, since_ns: now_ns, ..line };
        self.excuse(line, next, interval);
        self.line = Some(next);
    }

    /// Excuses a distance for some cycles if the demand is uneven from one line to the next.
    fn excuse(&mut self, line: Line, next: Line, interval: f64) {
        let is_even = (interval - 1.0).abs() <= JITTER
            && line.sent_ns + self.sending_ns <= next.since_ns
            && (next.step_m() - line.step_m()).abs() <= self.even_change_m;
        self.excused_syncs = self.excused_syncs.saturating_sub(1);
        if self.excused_syncs == 0 {
            self.excused_m = 0.0;
        }
        if !is_even {
            let longest_m = line.step_m().abs().max(next.step_m().abs());
            self.excused_m = self.excused_m.max(self.excused_steps * longest_m);
            self.excused_syncs = self.settling_syncs;
        }
    }

    /// Takes the position sampled at the last SYNC; returns the failure once too many in a row are beyond the limit.
    pub(super) fn judge(&mut self, position_m: f64) -> Option<Failure> {
        self.line?;
        let (error_m, limit_m) = (self.error_m(position_m), self.limit_m + self.excused_m);
        self.cycles_beyond = if error_m > limit_m { self.cycles_beyond + 1 } else { 0 };
        (self.cycles_beyond >= self.limit_cycles)
            .then(|| Failure::with(Cause::FollowingError, [error_m, limit_m]))
    }

    /// Cycles in a row in which the drive's position may be missing, up to `most`: an unseen drive may stand still.
    pub(super) fn may_miss_cycles(&self, most: u32) -> u32 {
        let step_m = self.line.map_or(0.0, |line| line.step_m().abs());
        let cycles = UNSEEN_LIMITS * self.limit_m / step_m;
        (cycles.min(f64::from(most)) as u32).max(1)
    }

    /// Distance of a position from the demands of the drive's lag, m; not positive between them.
    fn error_m(&self, position_m: f64) -> f64 {
        let newest = self.demands[0];
        let is_lag = |demand: &&Demand| {
            self.periods(newest.sync_ns.saturating_sub(demand.sync_ns)) <= self.lag_periods + JITTER
        };
        let [mut low_m, mut high_m] = [newest.position_m; 2];
        for demand in self.demands.iter().take_while(is_lag) {
            (low_m, high_m) = (low_m.min(demand.position_m), high_m.max(demand.position_m));
        }
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
    const SENDING_NS: u64 = 300_000;
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
            let drive = Line { from_m: START_M, to_m: START_M, since_ns: 0, target_m: START_M, sent_ns: 0 };
            let monitor = Following::new(&scenario, 3, SENDING_NS);
            Self { monitor, now_ns: 0, sent_m: START_M, received_m: None, drive }
        }

        /// SYNC so long after the last; the position that the drive samples.
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

    /// By a drive without inertia; the emulated ones go on a little, so that they bear one lost target.
    #[test]
    fn a_lost_target_is_noticed_when_the_drive_should_be_there() {
        let mut bench = Bench::new(|_| {});
        bench.run();
        // Sent in cycle 0, taken in cycle 1, reached in cycle 2.
        assert_eq!(bench.cycles_until_failure(), Some(2));
        let position_m = bench.sync(MS);
        let failure = bench.monitor.judge(position_m).unwrap();
        assert_eq!((failure.cause, failure.limit), (Cause::FollowingError, 7.5e-5));
        assert!((failure.value - 2.0 * STEP_M).abs() < 1e-9, "{}", failure.value);
    }

    #[test]
    fn an_uneven_demand_excuses_an_error_for_some_cycles_only() {
        let mut bench = Bench::new(|_| {});
        bench.run();
        bench.cycle(MS + MS / 2, false);
        assert_eq!(bench.cycles_until_failure(), Some(4), "that of the third lost target is too large");
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
        let position_m = bench.sync(MS);
        bench.send_after(MS - SENDING_NS + 1, position_m, true);
        bench.received_m = Some(bench.sent_m - STEP_M);
        for _ in 0..20 {
            let position_m = bench.sync(MS);
            assert_eq!(bench.monitor.judge(position_m), None);
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

    /// A drive is late by a time, whatever the rate.
    #[test]
    fn at_high_rates_an_uneven_demand_excuses_the_way_of_a_millisecond_and_12_ms() {
        for (rate_hz, steps, syncs) in [(500, 2.0, 12), (1000, 2.0, 12), (20_000, 21.0, 240)] {
            let monitor = Following::new(&Scenario { rate_hz, ..Scenario::default() }, 3, SENDING_NS);
            assert_eq!((monitor.excused_steps, monitor.settling_syncs), (steps, syncs), "{rate_hz} Hz");
        }
    }

    #[test]
    fn so_many_in_a_row_must_be_beyond_the_limit() {
        let mut bench = Bench::new(|scenario| scenario.can.following_limit_cycles = 3);
        bench.run();
        assert_eq!(bench.cycles_until_failure(), Some(4));
    }

    #[test]
    fn a_drive_that_follows_nothing_may_be_anywhere() {
        let mut bench = Bench::new(|_| {});
        assert_eq!(bench.monitor.judge(0.0), None, "before the drives are enabled");
        bench.run();
        bench.monitor.stop();
        assert_eq!(bench.monitor.judge(0.0), None);
        bench.monitor.synchronise(bench.now_ns + MS);
        bench.monitor.follow(bench.now_ns + MS, 0.1, 0.1);
        bench.monitor.synchronise(bench.now_ns + 2 * MS);
        assert_eq!(bench.monitor.judge(0.1), None, "the demand begins where the drive is");
        assert!(bench.monitor.judge(START_M).is_some());
    }

    #[test]
    fn a_drive_that_smooths_its_targets_lags_by_the_lead() {
        for (lead_cycles, lag, follows) in
            [(2.0, 0, true), (2.0, 2, false), (4.5, 3, true), (4.5, 5, false), (10.0, 8, true)]
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
        bench.monitor.follow(0, START_M, START_M + 0.01);
        let drive = Scenario::default().drives.leg;
        for cycle in 0..20 {
            bench.now_ns += MS;
            bench.monitor.synchronise(bench.now_ns);
            let way_m = f64::from(cycle) * drive.max_velocity_m_s * 1e-3;
            assert_eq!(bench.monitor.judge(START_M + way_m), None, "cycle {cycle}");
        }
    }
}
