//! The demand of an axis over time, and the command of the servo that follows from it. The demand knows neither modes nor
//! limits of the servo.

use super::motion::{Motion, clamp};
use super::profile::Profile;

/// The command of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ServoCommand {
    /// No current; the brake holds where it closed.
    Brake,
    /// Follow a position with its velocity.
    Follow(Motion),
    /// Keep a velocity within its range, wherever the axis is.
    Speed {
        /// Desired velocity, m/s.
        velocity_m_s: f64,
    },
    /// Apply a force while the velocity is within its range.
    Force {
        /// Desired force, N.
        force_n: f64,
    },
}

/// A value that changes evenly up to a target, and stays there.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Ramp {
    pub(super) from_ns: u64,
    pub(super) start: f64,
    pub(super) target: f64,
    /// Size of the change in a second.
    pub(super) rate_per_s: f64,
}

impl Ramp {
    /// The target at once.
    pub(super) const fn at_once(target: f64) -> Self {
        Self { from_ns: 0, start: target, target, rate_per_s: 0.0 }
    }

    /// The value at that time.
    pub(super) fn at(&self, now_ns: u64) -> f64 {
        let way = self.target - self.start;
        let moved = now_ns.saturating_sub(self.from_ns) as f64 * 1e-9 * self.rate_per_s;
        if moved >= way.abs() { self.target } else { self.start + moved.copysign(way) }
    }
}

/// The demand of an axis.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) enum Demand {
    /// No demand: the brake is closed.
    Brake,
    /// A straight line from one target to the next within a period, then rest.
    Interpolate { from_m: f64, to_m: f64, from_ns: u64, period_s: f64 },
    /// A ramp or a whole positioning.
    Profile(Profile),
    /// A velocity, m/s.
    Speed(Ramp),
    /// A force, N.
    Force(Ramp),
}

impl Demand {
    /// The demanded motion; none while the brake is closed, and for a velocity or a force.
    pub(super) fn at(&self, now_ns: u64) -> Option<Motion> {
        match self {
            Self::Brake | Self::Speed(_) | Self::Force(_) => None,
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
            (Self::Speed(ramp), _) => ServoCommand::Speed { velocity_m_s: ramp.at(now_ns) },
            (Self::Force(ramp), _) => ServoCommand::Force { force_n: ramp.at(now_ns) },
            (_, Some(motion)) => ServoCommand::Follow(motion),
            (_, None) => ServoCommand::Brake,
        }
    }

    /// The demanded position, if there is one.
    pub(super) fn position_m(&self, now_ns: u64) -> Option<f64> {
        self.at(now_ns).map(|motion| motion.position_m)
    }

    /// Interpolates to a target over the coming period, from the end of the present demand or from `actual_m`. Limits
    /// the way by the velocity limit, and returns whether the limit has cut the way.
    pub(super) fn interpolate(
        &mut self,
        now_ns: u64,
        actual_m: f64,
        target_m: f64,
        period_s: f64,
        limit_m_s: f64,
    ) -> bool {
        let from_m = match self {
            Self::Brake | Self::Speed(_) | Self::Force(_) => actual_m,
            Self::Interpolate { to_m, .. } => *to_m,
            Self::Profile(profile) => profile.at(now_ns).position_m,
        };
        let limit_m = limit_m_s * period_s;
        let (step_m, is_limited) = clamp(target_m - from_m, [-limit_m, limit_m]);
        *self = Self::Interpolate { from_m, to_m: from_m + step_m, from_ns: now_ns, period_s };
        is_limited
    }

    /// Slows down from the demanded position (the actual position where none is demanded) and the actual velocity. A velocity
    /// farther than `most_apart_m_s` from all that was demanded does not count: an encoder that jumps shows such a one. The
    /// demanded velocity alone is no guide: at SYNC, the time of the command, it is zero at the end of a line. A closed
    /// brake stays closed.
    pub(super) fn slow_down(
        &mut self,
        now_ns: u64,
        actual: Motion,
        deceleration_m_s2: f64,
        most_apart_m_s: f64,
    ) {
        // A step of the velocity takes time: all velocities of its ramp count as demanded.
        let [first_m_s, last_m_s] = match self {
            Self::Brake => return,
            Self::Force(_) => [actual.velocity_m_s; 2],
            Self::Speed(ramp) => [ramp.start, ramp.at(now_ns)],
            Self::Interpolate { from_m, to_m, period_s, .. } => [0.0, (*to_m - *from_m) / *period_s],
            Self::Profile(profile) => [0.0, profile.at(now_ns).velocity_m_s],
        };
        let [low_m_s, high_m_s] = [first_m_s.min(last_m_s).min(0.0), first_m_s.max(last_m_s).max(0.0)];
        let (velocity_m_s, _) =
            clamp(actual.velocity_m_s, [low_m_s - most_apart_m_s, high_m_s + most_apart_m_s]);
        let position_m = self.position_m(now_ns).unwrap_or(actual.position_m);
        *self = Self::Profile(Profile::stop(now_ns, Motion { position_m, velocity_m_s }, deceleration_m_s2));
    }

    /// Whether the demand is no motion.
    pub(super) fn is_at_rest(&self, now_ns: u64) -> bool {
        match self {
            Self::Brake => true,
            Self::Speed(_) | Self::Force(_) => false,
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
        demand.slow_down(MS, Motion { position_m: 0.27, velocity_m_s: 0.2 }, 10.0, 0.1);
        // 0.2 m/s at 10 m/s²: 20 ms and 2 mm.
        assert!(!demand.is_at_rest(MS + 19 * MS));
        assert!(demand.is_at_rest(MS + 21 * MS));
        assert!((demand.position_m(100 * MS).unwrap() - 0.2722).abs() < 1e-9);
    }

    /// A line at 0.2 m/s, or rest; an encoder that jumps shows 8 m/s.
    #[test]
    fn it_slows_down_from_no_velocity_that_nothing_asked_for() {
        for (velocity_m_s, expected_m_s) in [(0.29, 0.29), (8.0, 0.3), (-0.09, -0.09), (-8.0, -0.1)] {
            let mut demand = Demand::Brake;
            approach(&mut demand, 0, 0.2702);
            demand.slow_down(MS, Motion { position_m: 0.27, velocity_m_s }, 10.0, 0.1);
            let begin_m_s = demand.at(MS).unwrap().velocity_m_s;
            assert!((begin_m_s - expected_m_s).abs() < 1e-9, "{velocity_m_s}: {begin_m_s}");
        }
    }

    #[test]
    fn a_ramp_changes_evenly_and_ends_at_its_target() {
        for [start, target, half] in [[0.1, 0.3, 0.2], [0.3, -0.1, 0.2]] {
            let ramp = Ramp { from_ns: MS, start, target, rate_per_s: 10.0 };
            for (now_ns, value) in [(0, start), (MS, start), (50 * MS, target)] {
                assert_eq!(ramp.at(now_ns).to_bits(), value.to_bits());
            }
            assert!((ramp.at(11 * MS) - half).abs() < 1e-12);
        }
        assert_eq!(Ramp::at_once(7.0).at(0).to_bits(), 7.0_f64.to_bits());
    }

    #[test]
    fn from_a_force_it_slows_down_where_the_axis_is() {
        let mut demand = Demand::Force(Ramp::at_once(20.0));
        assert_eq!(demand.servo_command(0), ServoCommand::Force { force_n: 20.0 });
        demand.slow_down(0, Motion { position_m: 0.28, velocity_m_s: 0.1 }, 10.0, 0.1);
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
        assert!(!Demand::Force(Ramp::at_once(1.0)).is_at_rest(20 * MS));
        let mut demand = Demand::Brake;
        assert_eq!(demand.servo_command(20 * MS), ServoCommand::Brake);
        demand.slow_down(20 * MS, Motion { position_m: 0.27, velocity_m_s: 0.1 }, 10.0, 0.1);
        assert_eq!(demand.servo_command(21 * MS), ServoCommand::Brake, "a closed brake stays closed");
    }
}
