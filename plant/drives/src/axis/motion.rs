//! Motion of an axis: the values that its parts exchange, profiles, and the demand over time.
//!
//! A profile has piecewise constant acceleration: from any velocity to rest, at a target or as soon as the ramp allows.
//! The closed form holds at every instant, so that no error accumulates. Jerk is not limited.

use super::parameters::MotionLimits;
use crate::dictionary::Objects;
use crate::names;

/// Position and velocity of an axis at an instant.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Motion {
    /// Position, m.
    pub(crate) position_m: f64,
    /// Velocity, m/s.
    pub(crate) velocity_m_s: f64,
}

impl Motion {
    /// At rest at a position.
    pub(crate) const fn at_rest(position_m: f64) -> Self {
        Self { position_m, velocity_m_s: 0.0 }
    }
}

/// The value clamped to `[low, high]`, and whether it was outside.
pub(super) fn clamp(asked: f64, [low, high]: [f64; 2]) -> (f64, bool) {
    let kept = asked.max(low).min(high);
    (kept, kept.to_bits() != asked.to_bits())
}

/// Mode of operation (6060h).
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Mode {
    ProfilePosition = 1,
    ProfileVelocity = 3,
    ProfileTorque = 4,
    Homing = 6,
    CyclicPosition = 8,
    CyclicVelocity = 9,
    CyclicTorque = 10,
}

impl Mode {
    /// The mode of that number; `None` for an unknown mode.
    pub(crate) fn from_number(number: i8) -> Option<Self> {
        let profiles = [Self::ProfilePosition, Self::ProfileVelocity, Self::ProfileTorque, Self::Homing];
        let cyclic = [Self::CyclicPosition, Self::CyclicVelocity, Self::CyclicTorque];
        let mut modes = profiles.into_iter().chain(cyclic);
        modes.find(|mode| mode.number() == number)
    }

    /// The mode of that number; `None` where the dictionary (6502h) does not support it.
    pub(crate) fn supported(number: i8, objects: &Objects) -> Option<Self> {
        let mode = Self::from_number(number)?;
        (objects.get(names::SUPPORTED_MODES) >> (number - 1) & 1 == 1).then_some(mode)
    }

    /// The mode's number.
    pub(crate) const fn number(self) -> i8 {
        self as i8
    }
}

/// Targets that are new; those of the cyclic modes wait for SYNC.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct NewTargets {
    /// Target position (607Ah).
    pub(crate) position: bool,
    /// Target torque (6071h).
    pub(crate) torque: bool,
    /// Target velocity (60FFh).
    pub(crate) velocity: bool,
}

/// Positions of an axis as a mode of operation sees them, increments of the dictionary.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct PositionView {
    /// Position actual value (6064h).
    pub(super) actual: i32,
    /// Lowest and highest target that the software position limits allow from here.
    pub(super) allowed: [i32; 2],
}

impl PositionView {
    /// The nearest allowed target.
    pub(super) fn clamp(self, target: i32) -> i32 {
        let [lowest, highest] = self.allowed;
        target.min(highest).max(lowest)
    }
}

/// A command of a mode of operation to its axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum MotionCommand {
    /// Move to rest at a target, increments of the dictionary.
    MoveTo { target: i32 },
    /// Slow down to rest.
    SlowDown,
    /// Come to rest at once in place: the axis stands at a stop.
    Hold,
    /// Make that count of the encoder the home position.
    SetHome { counts: i32 },
}

/// A stretch of constant acceleration.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
struct Phase {
    duration_s: f64,
    acceleration_m_s2: f64,
}

/// Positions on one line over time; at rest at the end.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Profile {
    from_ns: u64,
    start: Motion,
    /// Stop, speed up or slow down to the limit, cruise, slow down. The stop is only for an axis that moves away from
    /// the target or cannot stop before the target.
    phases: [Phase; 4],
    end_m: f64,
}

impl Profile {
    /// To rest at that deceleration.
    pub(super) fn stop(from_ns: u64, start: Motion, deceleration_m_s2: f64) -> Self {
        let Motion { position_m, velocity_m_s } = start;
        let duration_s = velocity_m_s.abs() / deceleration_m_s2;
        let stop = Phase { duration_s, acceleration_m_s2: -deceleration_m_s2 * velocity_m_s.signum() };
        let end_m = position_m + velocity_m_s * duration_s / 2.0;
        let phases = [stop, Phase::default(), Phase::default(), Phase::default()];
        Self { from_ns, start, phases, end_m }
    }

    /// To rest at a target, as fast as the limits allow.
    pub(super) fn to(from_ns: u64, start: Motion, target_m: f64, limits: &MotionLimits) -> Self {
        let stop = Self::stop(from_ns, start, limits.deceleration_m_s2);
        let way_m = target_m - start.position_m;
        let shortest_m = stop.end_m - start.position_m;
        let is_wrong_way = shortest_m * way_m < 0.0 || shortest_m.abs() > way_m.abs();
        let (begin, first) = if is_wrong_way {
            (Motion::at_rest(stop.end_m), stop.phases[0])
        } else {
            (start, Phase::default())
        };
        let [speed_up, cruise, slow_down] =
            trapezoid(target_m - begin.position_m, begin.velocity_m_s, limits);
        Self { from_ns, start, phases: [first, speed_up, cruise, slow_down], end_m: target_m }
    }

    /// The motion at that time.
    pub(super) fn at(&self, now_ns: u64) -> Motion {
        let mut left_s = now_ns.saturating_sub(self.from_ns) as f64 * 1e-9;
        let Motion { mut position_m, mut velocity_m_s } = self.start;
        for Phase { duration_s, acceleration_m_s2 } in self.phases {
            let time_s = left_s.min(duration_s);
            position_m += (velocity_m_s + acceleration_m_s2 * time_s / 2.0) * time_s;
            velocity_m_s += acceleration_m_s2 * time_s;
            if left_s < duration_s {
                return Motion { position_m, velocity_m_s };
            }
            left_s -= duration_s;
        }
        Motion::at_rest(self.end_m)
    }

    /// Whether it has come to rest.
    pub(super) fn is_over(&self, now_ns: u64) -> bool {
        let lasts_s: f64 = self.phases.iter().map(|phase| phase.duration_s).sum();
        now_ns.saturating_sub(self.from_ns) as f64 * 1e-9 >= lasts_s
    }
}

/// Speed up, cruise and slow down. The way is long enough for a stop from the initial velocity, which points along the
/// way.
fn trapezoid(way_m: f64, velocity_m_s: f64, limits: &MotionLimits) -> [Phase; 3] {
    let direction = if way_m < 0.0 { -1.0 } else { 1.0 };
    let (way_m, begin_m_s) = (way_m.abs(), velocity_m_s.abs());
    let MotionLimits { velocity_m_s: limit_m_s, acceleration_m_s2: up, deceleration_m_s2: down } = *limits;
    // v² = v₀² + 2·up·s₁ and v² = 2·down·s₂, with s₁ + s₂ the whole way.
    let highest_m_s = ((way_m + begin_m_s.powi(2) / (2.0 * up)) / (0.5 / up + 0.5 / down)).sqrt();
    let cruise_m_s = highest_m_s.min(limit_m_s);
    let change = if cruise_m_s < begin_m_s { -down } else { up };
    let first_s = (cruise_m_s - begin_m_s) / change;
    let first_m = f64::midpoint(begin_m_s, cruise_m_s) * first_s;
    let last_s = cruise_m_s / down;
    let cruise_way_m = (way_m - first_m - cruise_m_s * last_s / 2.0).max(0.0);
    let cruise_s = if cruise_way_m > 0.0 { cruise_way_m / cruise_m_s } else { 0.0 };
    [
        Phase { duration_s: first_s, acceleration_m_s2: direction * change },
        Phase { duration_s: cruise_s, acceleration_m_s2: 0.0 },
        Phase { duration_s: last_s, acceleration_m_s2: -direction * down },
    ]
}

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

    /// Slows down from the demanded position (the actual position where none is demanded) and the actual velocity, but not from a
    /// velocity farther than `most_apart_m_s` from all that was demanded: an encoder that jumps shows such a one. The
    /// demanded velocity alone is no guide: at SYNC, the time of the command, it is zero at the end of a line. A closed
    /// brake stays closed.
    pub(super) fn slow_down(
        &mut self,
        now_ns: u64,
        actual: Motion,
        deceleration_m_s2: f64,
        most_apart_m_s: f64,
    ) {
        let demanded_m_s = match self {
            Self::Brake => return,
            Self::Speed(_) | Self::Force(_) => actual.velocity_m_s,
            Self::Interpolate { from_m, to_m, period_s, .. } => (*to_m - *from_m) / *period_s,
            Self::Profile(profile) => profile.at(now_ns).velocity_m_s,
        };
        let [low_m_s, high_m_s] = [demanded_m_s.min(0.0), demanded_m_s.max(0.0)];
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
mod motion_tests {
    use super::*;

    #[test]
    fn a_value_outside_becomes_the_nearer_limit_and_is_reported() {
        let table = [(3.0, (2.0, true)), (2.0, (2.0, false)), (-0.0, (-0.0, false)), (-5.0, (-1.0, true))];
        for (asked, kept) in table {
            assert_eq!(clamp(asked, [-1.0, 2.0]), kept);
        }
    }

    #[test]
    fn a_target_is_moved_to_the_nearest_end_of_what_is_allowed() {
        let view = PositionView { actual: 0, allowed: [-20, 30] };
        assert_eq!([-50, -20, 5, 30, 50].map(|target| view.clamp(target)), [-20, -20, 5, 30, 30]);
    }

    #[test]
    fn a_mode_has_the_number_of_cia_402() {
        let numbers: Vec<_> =
            (i8::MIN..=i8::MAX).filter(|&number| Mode::from_number(number).is_some()).collect();
        assert_eq!(numbers, [1, 3, 4, 6, 8, 9, 10]);
        for number in numbers {
            assert_eq!(Mode::from_number(number).map(Mode::number), Some(number));
        }
    }
}

#[cfg(test)]
mod profile_tests {
    use proptest::prelude::*;

    use super::*;

    const LIMITS: MotionLimits =
        MotionLimits { velocity_m_s: 0.1, acceleration_m_s2: 1.0, deceleration_m_s2: 2.0 };
    const STEP_NS: u64 = 100_000;

    /// The profile sampled every 0.1 ms until it is over.
    fn samples(profile: &Profile) -> Vec<Motion> {
        let times = (0..1_000_000).map(|step| step * STEP_NS);
        let until_over = times.take_while(|&time_ns| !profile.is_over(time_ns));
        until_over.map(|time_ns| profile.at(time_ns)).collect()
    }

    #[test]
    fn from_rest_it_takes_the_time_of_the_trapezoid() {
        // 0.1 s up (5 mm), 0.05 s down (2.5 mm), the other 42.5 mm at 0.1 m/s in 0.425 s.
        let profile = Profile::to(0, Motion::at_rest(0.2), 0.25, &LIMITS);
        assert!(!profile.is_over(574_999_000));
        assert!(profile.is_over(575_001_000));
        let Motion { position_m, velocity_m_s } = profile.at(300_000_000);
        assert!((velocity_m_s - 0.1).abs() < 1e-12);
        assert!((position_m - 0.225).abs() < 1e-12);
        assert_eq!(profile.at(u64::MAX), Motion::at_rest(0.25));
    }

    #[test]
    fn a_short_way_is_a_triangle() {
        let profile = Profile::to(0, Motion::at_rest(0.0), -0.001, &LIMITS);
        let fastest = samples(&profile).iter().fold(0.0_f64, |fastest, at| fastest.min(at.velocity_m_s));
        assert!((-0.0366..-0.0364).contains(&fastest), "{fastest}");
    }

    #[test]
    fn an_axis_too_fast_to_stop_in_time_turns_round() {
        let profile = Profile::to(0, Motion { position_m: 0.0, velocity_m_s: 0.1 }, 0.001, &LIMITS);
        let furthest = samples(&profile).iter().fold(0.0_f64, |furthest, at| furthest.max(at.position_m));
        assert!((furthest - 0.0025).abs() < 1e-6, "{furthest}");
        assert_eq!(profile.at(u64::MAX), Motion::at_rest(0.001));
    }

    #[test]
    fn an_axis_on_its_way_does_not_stop_first() {
        let profile = Profile::to(0, Motion { position_m: 0.2, velocity_m_s: 0.05 }, 0.25, &LIMITS);
        let at = profile.at(20_000_000);
        assert!((at.velocity_m_s - 0.07).abs() < 1e-12, "{at:?}");
    }

    #[test]
    fn a_stop_takes_the_way_of_its_ramp() {
        let profile = Profile::stop(0, Motion { position_m: 0.27, velocity_m_s: 0.2 }, 10.0);
        assert!(!profile.is_over(19_000_000) && profile.is_over(21_000_000));
        assert!((profile.end_m - 0.272).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn it_is_continuous_within_its_limits_and_arrives(
            position_m in -0.1..0.1_f64,
            velocity_m_s in -0.2..0.2_f64,
            target_m in -0.1..0.1_f64,
            limit_m_s in 0.01..0.2_f64,
            up in 0.1..20.0_f64,
            down in 0.1..20.0_f64,
        ) {
            let limits = MotionLimits {
                velocity_m_s: limit_m_s,
                acceleration_m_s2: up,
                deceleration_m_s2: down,
            };
            let start = Motion { position_m, velocity_m_s };
            let profile = Profile::to(0, start, target_m, &limits);
            let step_s = STEP_NS as f64 * 1e-9;
            let fastest = limit_m_s.max(velocity_m_s.abs()) + 1e-9;
            let mut before = start;
            for now in samples(&profile).into_iter().chain([Motion::at_rest(target_m)]) {
                prop_assert!(now.velocity_m_s.abs() <= fastest);
                prop_assert!((now.position_m - before.position_m).abs() <= fastest * step_s + 1e-9);
                let change_m_s = now.velocity_m_s - before.velocity_m_s;
                prop_assert!(change_m_s.abs() <= up.max(down) * step_s + 1e-9);
                before = now;
            }
        }
    }
}

#[cfg(test)]
mod demand_tests {
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
