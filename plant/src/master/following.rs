//! The following error of one drive: the distance of its position from the demand of its targets.
//!
//! A drive takes its newest target at SYNC and reaches the target on a straight line within a period. The drive may lag
//! behind by the time that `controller.lead_cycles` allows. So the demand at every SYNC, the time of the position's
//! sample, follows from the targets.
//!
//! A real drive cannot follow an uneven demand: SYNC comes early or late or overtakes the target, or the targets stop
//! or start at once. For some cycles after that, the drive may be farther away.

#[cfg(test)]
mod tests;

use masseter_runtime::messages::codes::Cause;
use masseter_scenario::{MOST_LEAD_CYCLES, Scenario};

use super::events::Failure;

/// Periods from a target's command until every drive has reached the target: one until SYNC, one for the line.
const LEAST_LEAD_CYCLES: f64 = 2.0;
/// Deviation of an even SYNC from its time, in periods.
const JITTER: f64 = 0.1;
/// Largest acceleration of an even demand. The default motions take 1.3 m/s². A drive that stops at once from such a
/// change stays within the limit of the following error.
const EVEN_CHANGE_M_S2: f64 = 40.0;
/// Least SYNCs, and least time, until a drive has settled after an uneven demand. The emulated drives' error falls by 12 %
/// a millisecond.
const SETTLING_SYNCS: u32 = 12;
const SETTLING_S: f64 = 0.012;
/// Time by which a drive brakes and accelerates late after an uneven demand, at least a period.
const LATE_S: f64 = 0.001;
/// Largest missed way of a drive with an unknown position, in limits of the following error.
const UNSEEN_LIMITS: f64 = 4.0;
/// Demands that are kept: SYNCs may follow each other within half a period.
const KEPT: usize = 2 * MOST_LEAD_CYCLES;

/// The demand between two SYNCs.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Line {
    from_m: f64,
    to_m: f64,
    /// SYNC, at which the line begins, ns.
    since_ns: u64,
    /// The last target, m, and the time of its transmission, ns.
    target_m: f64,
    sent_ns: u64,
}

/// The demand at a SYNC.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct Demand {
    sync_ns: u64,
    position_m: f64,
}

/// The monitor of one drive.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
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
    /// Distance that an uneven demand excuses, in steps of that demand. One step is for a target that SYNC overtakes.
    /// One is for the swing and the sticking of a suddenly held mechanism, the others for the drive's lateness.
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
    /// The monitor of the drive of an axis, without a target. A target sent less than `sending_ns` before SYNC may miss
    /// SYNC.
    pub(super) fn new(scenario: &Scenario, axis: usize, sending_ns: u64) -> Self {
        let (drive, period_s) = (scenario.drives.of_axis(axis), scenario.period_s());
        Self {
            limit_m: scenario.can.following_limit_m,
            limit_cycles: scenario.can.following_limit_cycles,
            period_ns: scenario.period_ns() as f64,
            sending_ns,
            longest_step_m: drive.max_velocity_m_s * period_s,
            even_change_m: EVEN_CHANGE_M_S2 * period_s * period_s,
            excused_steps: 2.0 + (LATE_S / period_s).max(1.0),
            settling_syncs: SETTLING_SYNCS.max((SETTLING_S / period_s).ceil() as u32),
            lag_periods: (scenario.controller.lead_cycles - LEAST_LEAD_CYCLES).ceil().max(0.0),
            line: None,
            demands: [Demand::default(); KEPT],
            excused_m: 0.0,
            excused_syncs: 0,
            cycles_beyond: 0,
        }
    }

    /// Notes a target sent to a following drive at `position_m`.
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

    /// Notes that the drive follows no targets.
    pub(super) fn stop(&mut self) {
        self.line = None;
    }

    /// Notes SYNC at `now_ns`: the drive samples its position and takes the last target, within its greatest speed.
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

    /// Takes the position sampled at the last SYNC. Returns the failure after too many positions in a row beyond the
    /// limit.
    pub(super) fn following_failure(&mut self, position_m: f64) -> Option<Failure> {
        self.line?;
        let (error_m, limit_m) = (self.error_m(position_m), self.limit_m + self.excused_m);
        self.cycles_beyond = if error_m > limit_m { self.cycles_beyond + 1 } else { 0 };
        (self.cycles_beyond >= self.limit_cycles)
            .then(|| Failure::with(Cause::FollowingError, error_m, limit_m))
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
