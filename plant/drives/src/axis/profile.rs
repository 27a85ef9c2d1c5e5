//! Profiles of position: piecewise constant acceleration from any velocity to rest, at a target or as soon as the ramp
//! allows.
//!
//! The closed form holds at every instant, so that no error accumulates. Jerk is not limited.

use super::{motion::Motion, parameters::MotionLimits};

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

#[cfg(test)]
mod tests {
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
