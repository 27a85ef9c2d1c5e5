//! A share, 0 to 1, that follows its target with limited speed and acceleration.

use masseter_model::geometry::AXES;
use masseter_scenario::TrajectoryLimitsConfig;

use crate::trajectory::TrajectoryReport;

/// Shortest and longest time of a change from 0 to 1, s.
const SHORTEST_S: f64 = 1.0;
const LONGEST_S: f64 = 60.0;
/// A change gathers speed and loses it in a third of its time each.
const SPEED: f64 = 1.5;
const ACCELERATION: f64 = 4.5;
/// By how much more than in proportion the axes may move with the share.
const BEND: f64 = 1.25;

/// The share.
#[derive(Debug, Clone)]
pub(crate) struct Slew {
    /// The present share.
    pub(crate) value: f64,
    target: f64,
    per_s: f64,
    most_per_s: f64,
    most_per_s2: f64,
}

impl Slew {
    /// The whole, whose change to nothing takes this long, s.
    pub(crate) fn of(change_s: f64) -> Self {
        let (most_per_s, most_per_s2) = (SPEED / change_s, ACCELERATION / (change_s * change_s));
        Self { value: 1.0, target: 1.0, per_s: 0.0, most_per_s, most_per_s2 }
    }

    /// The shortest time of a change of rate or amplitude from 0 to 1, of both at once too, that leaves a motion with these
    /// demands within its limits, s. Without demands it is the longest.
    pub(crate) fn change_s(demands: Option<&TrajectoryReport>, limits: &TrajectoryLimitsConfig) -> f64 {
        let Some(demands) = demands else { return LONGEST_S };
        let of_axis = |axis: usize| {
            let way_m = BEND * (demands.highest_m[axis] - demands.lowest_m[axis]);
            let (velocity_m_s, acceleration_m_s2) =
                (demands.velocity_m_s[axis], demands.acceleration_m_s2[axis]);
            let left_m_s = (limits.velocity_m_s(axis) - velocity_m_s).max(0.0);
            let left_m_s2 = (limits.acceleration_m_s2(axis) - acceleration_m_s2).max(0.0);
            // Twice for the amplitude's change of a moving axis, once for that of its rate.
            let moving = 3.0 * SPEED * velocity_m_s;
            let root = (moving * moving + 4.0 * left_m_s2 * ACCELERATION * way_m).sqrt();
            (SPEED * way_m / left_m_s).max((moving + root) / (2.0 * left_m_s2))
        };
        (0..AXES).map(of_axis).fold(SHORTEST_S, f64::max).min(LONGEST_S)
    }

    /// Sets where it goes.
    pub(crate) fn set(&mut self, target: f64) {
        self.target = target;
    }

    /// Goes there at once.
    pub(crate) fn jump(&mut self) {
        (self.value, self.per_s) = (self.target, 0.0);
    }

    /// Whether it has arrived.
    pub(crate) fn is_settled(&self) -> bool {
        self.value.to_bits() == self.target.to_bits() && self.per_s == 0.0
    }

    /// What it is in that time.
    pub(crate) fn ahead(&self, ahead_s: f64) -> f64 {
        (self.value + self.per_s * ahead_s).clamp(0.0, 1.0)
    }

    /// Lets `dt_s` pass.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        let left = self.target - self.value;
        let step_per_s = self.most_per_s2 * dt_s;
        if left.abs() <= step_per_s * dt_s && self.per_s.abs() <= step_per_s {
            self.jump();
            return;
        }
        // From this speed it comes to rest exactly at the target, in steps of this length.
        let half_step = step_per_s / 2.0;
        let arriving_per_s = (half_step * half_step + 2.0 * self.most_per_s2 * left.abs()).sqrt() - half_step;
        let wanted_per_s = arriving_per_s.min(self.most_per_s).copysign(left);
        self.per_s += (wanted_per_s - self.per_s).clamp(-step_per_s, step_per_s);
        self.value += self.per_s * dt_s;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const STEP_S: f64 = 1e-3;

    #[test]
    fn the_whole_change_takes_its_time_and_ends_exactly() {
        let mut slew = Slew::of(2.0);
        slew.set(0.0);
        let steps = (1..10_000).find(|_| {
            slew.advance(STEP_S);
            slew.is_settled()
        });
        assert!((1.99..2.01).contains(&(f64::from(steps.unwrap()) * STEP_S)), "{steps:?}");
        assert_eq!(slew.value.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn a_motion_that_uses_its_limits_changes_slowly() {
        let limits = TrajectoryLimitsConfig::default();
        let demands = |velocity_m_s: f64, acceleration_m_s2: f64| TrajectoryReport {
            samples: 2,
            lowest_m: [0.0; AXES],
            highest_m: [0.02; AXES],
            velocity_m_s: [velocity_m_s; AXES],
            acceleration_m_s2: [acceleration_m_s2; AXES],
        };
        let change_s = |velocity_m_s, acceleration_m_s2| {
            Slew::change_s(Some(&demands(velocity_m_s, acceleration_m_s2)), &limits)
        };
        assert!((change_s(0.05, 1.0) - SHORTEST_S).abs() < 1e-12);
        assert!((change_s(0.14, 1.0) - 1.5 * 1.25 * 0.02 / 0.01).abs() < 1e-9);
        assert!((1.2..1.6).contains(&change_s(0.1, 7.6)), "{}", change_s(0.1, 7.6));
        for slowest_s in [change_s(0.15, 1.0), change_s(0.05, 8.0), Slew::change_s(None, &limits)] {
            assert!((slowest_s - LONGEST_S).abs() < 1e-12);
        }
    }

    proptest! {
        /// Whatever the targets are, and whenever they change.
        #[test]
        fn it_stays_within_its_limits(targets in prop::collection::vec((0.0..=1.0f64, 1..800usize), 1..9)) {
            let mut slew = Slew::of(1.0);
            let mut last = (slew.value, 0.0);
            for (target, steps) in targets {
                slew.set(target);
                for _ in 0..steps {
                    slew.advance(STEP_S);
                    let per_s = (slew.value - last.0) / STEP_S;
                    prop_assert!((-1e-9..=1.0 + 1e-9).contains(&slew.value));
                    prop_assert!(per_s.abs() <= SPEED + 1e-6);
                    prop_assert!((per_s - last.1).abs() / STEP_S <= 2.0 * ACCELERATION + 1e-6);
                    last = (slew.value, per_s);
                }
            }
        }
    }
}
