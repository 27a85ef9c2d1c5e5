//! The demand of an axis over time: none, a line to the next cyclic target, a profile, or a constant force.

use super::motion::{Motion, clamp};
use super::profile::Profile;
use super::servo::ServoCommand;

/// The demand of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Demand {
    /// No demand: the brake is closed.
    Brake,
    /// A straight line from one target to the next within a period, then rest.
    Interpolate { from_m: f64, to_m: f64, from_ns: u64, period_s: f64 },
    /// A ramp or a whole positioning.
    Profile(Profile),
    /// A force.
    Force { force_n: f64 },
}

impl Demand {
    /// The demanded motion; none while the brake is closed or a force is demanded.
    pub(super) fn at(&self, now_ns: u64) -> Option<Motion> {
        match self {
            Self::Brake | Self::Force { .. } => None,
            Self::Interpolate { from_m, to_m, from_ns, period_s } => {
                let share = now_ns.saturating_sub(*from_ns) as f64 * 1e-9 / period_s;
                let way_m = to_m - from_m;
                let moving = Motion { position_m: from_m + way_m * share, velocity_m_s: way_m / period_s };
                Some(if share < 1.0 { moving } else { Motion::at_rest(*to_m) })
            }
            Self::Profile(profile) => Some(profile.at(now_ns)),
        }
    }

    /// The servo's command at that time.
    pub(super) fn servo_command(&self, now_ns: u64) -> ServoCommand {
        match (self, self.at(now_ns)) {
            (Self::Force { force_n }, _) => ServoCommand::Force { force_n: *force_n },
            (_, Some(motion)) => ServoCommand::Follow(motion),
            (_, None) => ServoCommand::Brake,
        }
    }

    /// The demanded position, if there is one.
    pub(super) fn position_m(&self, now_ns: u64) -> Option<f64> {
        self.at(now_ns).map(|motion| motion.position_m)
    }

    /// Interpolates to a target over the coming period, from the end of the present demand or from `actual_m`.
    /// The way is limited by the velocity limit; returns whether it was.
    pub(super) fn interpolate(
        &mut self,
        now_ns: u64,
        actual_m: f64,
        target_m: f64,
        period_s: f64,
        limit_m_s: f64,
    ) -> bool {
        let from_m = match self {
            Self::Brake | Self::Force { .. } => actual_m,
            Self::Interpolate { to_m, .. } => *to_m,
            Self::Profile(profile) => profile.at(now_ns).position_m,
        };
        let limit_m = limit_m_s * period_s;
        let (step_m, is_limited) = clamp(target_m - from_m, [-limit_m, limit_m]);
        *self = Self::Interpolate { from_m, to_m: from_m + step_m, from_ns: now_ns, period_s };
        is_limited
    }

    /// Slows down from the demanded position (the actual one under a force) and the actual velocity. The demanded
    /// velocity is no guide: it is zero at the end of a line, which is when SYNC brings the command. A closed
    /// brake stays closed.
    pub(super) fn slow_down(&mut self, now_ns: u64, actual: Motion, deceleration_m_s2: f64) {
        if *self != Self::Brake {
            let position_m = self.position_m(now_ns).unwrap_or(actual.position_m);
            let start = Motion { position_m, ..actual };
            *self = Self::Profile(Profile::stop(now_ns, start, deceleration_m_s2));
        }
    }

    /// Whether the demand is no motion.
    pub(super) fn is_at_rest(&self, now_ns: u64) -> bool {
        match self {
            Self::Brake => true,
            Self::Force { .. } => false,
            Self::Profile(profile) => profile.is_over(now_ns),
            Self::Interpolate { .. } => self.at(now_ns).is_none_or(|motion| motion.velocity_m_s.abs() < 1e-9),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// At no more than 0.4 m/s, in cycles of a millisecond.
    fn approach(demand: &mut Demand, now_ns: u64, target_m: f64) -> bool {
        demand.interpolate(now_ns, 0.27, target_m, 1e-3, 0.4)
    }

    #[test]
    fn targets_are_reached_on_straight_lines_one_period_later() {
        let mut demand = Demand::Brake;
        assert_eq!(demand.position_m(0), None);
        assert!(!approach(&mut demand, 0, 0.2701));
        let position = |demand: &Demand, ns| demand.position_m(ns).unwrap();
        assert!((position(&demand, MS / 2) - 0.27005).abs() < 1e-12);
        approach(&mut demand, MS, 0.2703);
        assert!((position(&demand, MS) - 0.2701).abs() < 1e-12);
        assert!((position(&demand, 5 * MS) - 0.2703).abs() < 1e-12);
        assert!(demand.is_at_rest(5 * MS));
    }

    #[test]
    fn a_jump_is_limited_to_what_the_velocity_limit_allows() {
        let mut demand = Demand::Brake;
        assert!(approach(&mut demand, 0, 0.30));
        assert!((demand.position_m(MS).unwrap() - 0.2704).abs() < 1e-12);
    }

    #[test]
    fn it_slows_down_evenly_and_stays() {
        let mut demand = Demand::Brake;
        approach(&mut demand, 0, 0.2702);
        demand.slow_down(MS, Motion { position_m: 0.27, velocity_m_s: 0.2 }, 10.0);
        // 0.2 m/s at 10 m/s²: 20 ms and 2 mm.
        assert!(!demand.is_at_rest(MS + 19 * MS));
        assert!(demand.is_at_rest(MS + 21 * MS));
        assert!((demand.position_m(100 * MS).unwrap() - 0.2722).abs() < 1e-9);
    }

    #[test]
    fn from_a_force_it_slows_down_where_the_axis_is() {
        let mut demand = Demand::Force { force_n: 20.0 };
        assert_eq!(demand.servo_command(0), ServoCommand::Force { force_n: 20.0 });
        demand.slow_down(0, Motion { position_m: 0.28, velocity_m_s: 0.1 }, 10.0);
        assert!((demand.position_m(100 * MS).unwrap() - 0.2805).abs() < 1e-9);
    }

    #[test]
    fn a_line_to_a_target_is_straight_and_ends_there() {
        let mut demand = Demand::Brake;
        assert!(demand.is_at_rest(0));
        assert!(!demand.interpolate(5 * MS, 0.27, 0.2704, 2e-3, 0.4));
        assert!(!demand.is_at_rest(5 * MS));
        for (at_ms, position_m, velocity_m_s) in
            [(4, 0.27, 0.2), (5, 0.27, 0.2), (6, 0.2702, 0.2), (7, 0.2704, 0.0), (8, 0.2704, 0.0)]
        {
            let motion = demand.at(at_ms * MS).unwrap();
            assert!((motion.position_m - position_m).abs() < 1e-12, "{at_ms} ms: {motion:?}");
            assert!((motion.velocity_m_s - velocity_m_s).abs() < 1e-9, "{at_ms} ms: {motion:?}");
            assert_eq!(demand.servo_command(at_ms * MS), ServoCommand::Follow(motion));
        }
        assert!(demand.interpolate(7 * MS, 0.5, 0.26, 2e-3, 0.4), "backwards, too far");
        let end = demand.at(9 * MS).unwrap();
        assert!((end.position_m - 0.2696).abs() < 1e-12, "{end:?}");
        assert!(!Demand::Force { force_n: 1.0 }.is_at_rest(20 * MS));
        let mut demand = Demand::Brake;
        assert_eq!(demand.servo_command(20 * MS), ServoCommand::Brake);
        demand.slow_down(20 * MS, Motion { position_m: 0.27, velocity_m_s: 0.1 }, 10.0);
        assert_eq!(demand.servo_command(21 * MS), ServoCommand::Brake, "a closed brake stays closed");
    }
}
