//! The position demand of a drive: cyclic synchronous targets, interpolated, or the quick-stop ramp.

use super::servo::Task;

/// What the servo follows.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shape {
    /// No demand: the brake is closed.
    Brake,
    /// On a straight line from one target to the next, then at rest.
    Interpolate { from_m: f64, to_m: f64, from_ns: u64 },
    /// Slowing down.
    Ramp { position_m: f64, velocity_m_s: f64, from_ns: u64 },
}

/// Position demand as a function of time.
#[derive(Debug, Clone)]
pub(super) struct Demand {
    shape: Shape,
    period_s: f64,
    deceleration_m_s2: f64,
}

impl Demand {
    /// No demand. Targets come every `period_s` (object 60C2); the quick-stop ramp is object 6085.
    pub(super) fn new(period_s: f64, deceleration_m_s2: f64) -> Self {
        Self { shape: Shape::Brake, period_s, deceleration_m_s2 }
    }

    /// Position and velocity demanded, m and m/s; none while the brake is closed.
    fn at(&self, now_ns: u64) -> Option<(f64, f64)> {
        let since = |from_ns: u64| now_ns.saturating_sub(from_ns) as f64 * 1e-9;
        match self.shape {
            Shape::Brake => None,
            Shape::Interpolate { from_m, to_m, from_ns } => {
                let share = since(from_ns) / self.period_s;
                let velocity_m_s = (to_m - from_m) / self.period_s;
                Some(if share < 1.0 { (from_m + (to_m - from_m) * share, velocity_m_s) } else { (to_m, 0.0) })
            }
            Shape::Ramp { position_m, velocity_m_s, from_ns } => {
                let stop_s = velocity_m_s.abs() / self.deceleration_m_s2;
                let time_s = since(from_ns).min(stop_s);
                let slowing = self.deceleration_m_s2 * velocity_m_s.signum();
                let now_m_s = velocity_m_s - slowing * time_s;
                Some((position_m + f64::midpoint(velocity_m_s, now_m_s) * time_s, now_m_s))
            }
        }
    }

    /// The servo's task `ahead_ns` from now, when its force takes effect.
    pub(super) fn task(&self, now_ns: u64) -> Task {
        self.at(now_ns)
            .map_or(Task::Brake, |(position_m, velocity_m_s)| Task::Follow { position_m, velocity_m_s })
    }

    /// The position demanded; none while the brake is closed.
    pub(super) fn position_m(&self, now_ns: u64) -> Option<f64> {
        self.at(now_ns).map(|(position_m, _)| position_m)
    }

    /// Heads for a target over the coming period, from where the demand ends now or from `actual_m`.
    /// No further than `limit_m_s` allows; returns whether that cut it.
    pub(super) fn head_for(&mut self, now_ns: u64, target_m: f64, actual_m: f64, limit_m_s: f64) -> bool {
        let from_m = match self.shape {
            Shape::Brake => actual_m,
            Shape::Interpolate { to_m, .. } => to_m,
            Shape::Ramp { .. } => self.position_m(now_ns).unwrap_or(actual_m),
        };
        let most_m = limit_m_s * self.period_s;
        let step_m = (target_m - from_m).clamp(-most_m, most_m);
        self.shape = Shape::Interpolate { from_m, to_m: from_m + step_m, from_ns: now_ns };
        (target_m - from_m).abs() > most_m
    }

    /// Begins the quick-stop ramp at the present demand and the axis' actual velocity. The demanded one
    /// is no guide: SYNC brings the command just when a line ends, or after it, where it is zero.
    pub(super) fn slow_down(&mut self, now_ns: u64, velocity_m_s: f64) {
        if let Some(position_m) = self.position_m(now_ns) {
            self.shape = Shape::Ramp { position_m, velocity_m_s, from_ns: now_ns };
        }
    }

    /// Whether the demand no longer moves.
    pub(super) fn is_at_rest(&self, now_ns: u64) -> bool {
        self.at(now_ns).is_none_or(|(_, velocity_m_s)| velocity_m_s.abs() < 1e-9)
    }

    /// Lets the brake close.
    pub(super) fn release(&mut self) {
        self.shape = Shape::Brake;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn targets_are_reached_on_straight_lines_one_period_later() {
        let mut demand = Demand::new(1e-3, 10.0);
        assert_eq!(demand.position_m(0), None);
        assert!(!demand.head_for(0, 0.2701, 0.27, 0.4));
        let position = |demand: &Demand, ns| demand.position_m(ns).unwrap();
        assert!((position(&demand, MS / 2) - 0.27005).abs() < 1e-12);
        demand.head_for(MS, 0.2703, 0.0, 0.4);
        assert!((position(&demand, MS) - 0.2701).abs() < 1e-12);
        assert!((position(&demand, 5 * MS) - 0.2703).abs() < 1e-12);
        assert!(demand.is_at_rest(5 * MS));
    }

    #[test]
    fn a_jump_is_cut_to_what_the_velocity_limit_allows() {
        let mut demand = Demand::new(1e-3, 10.0);
        assert!(demand.head_for(0, 0.30, 0.27, 0.4));
        assert!((demand.position_m(MS).unwrap() - 0.2704).abs() < 1e-12);
    }

    #[test]
    fn the_quick_stop_ramp_slows_down_evenly_and_stays() {
        let mut demand = Demand::new(1e-3, 10.0);
        demand.head_for(0, 0.2702, 0.27, 0.4);
        demand.slow_down(MS, 0.2);
        // 0.2 m/s at 10 m/s²: 20 ms and 2 mm.
        assert!(!demand.is_at_rest(MS + 19 * MS));
        assert!(demand.is_at_rest(MS + 21 * MS));
        assert!((demand.position_m(100 * MS).unwrap() - 0.2722).abs() < 1e-9);
    }
}
