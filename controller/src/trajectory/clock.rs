//! The motion's own clock: it starts and stops smoothly, so that any motion starts and ends at rest
//! while its path stays what it is.

use super::rhythm::minimum_jerk_integral;

/// How long the clock takes to reach full speed, and to stop, s.
pub(super) const RAMP_S: f64 = 0.5;

/// Less is rounding, s.
const SHORTEST_CUT_S: f64 = 1e-6;

/// Maps the trajectory's time to the motion's time.
#[derive(Debug, Clone, Copy)]
pub(super) struct MotionClock {
    /// Share of real time at which it runs.
    speed: f64,
    ramp_s: f64,
    stopped_s: f64,
    pub duration_s: f64,
    /// What the motion takes to its end.
    whole_s: f64,
}

impl MotionClock {
    /// A clock for a motion of some length in a trajectory of some duration, both above 0.
    ///
    /// A ramp covers half its time, so a motion takes one ramp longer than its length. What is left
    /// of the duration is held; what does not fit into it is cut.
    pub(super) fn new(length_s: f64, duration_s: f64) -> Self {
        let ramp_s = RAMP_S.min(length_s).min(duration_s / 2.0);
        let whole_s = length_s + RAMP_S.min(length_s);
        Self { speed: 1.0, ramp_s, stopped_s: duration_s.min(length_s + ramp_s), duration_s, whole_s }
    }

    /// The same clock at a share of its speed.
    pub(super) fn slowed(self, speed: f64) -> Self {
        Self {
            speed: self.speed * speed,
            duration_s: self.duration_s / speed,
            whole_s: self.whole_s / speed,
            ..self
        }
    }

    /// What the motion would take to its end, s, where the duration cuts it by more than rounding.
    pub(super) fn cut_from_s(&self) -> Option<f64> {
        (self.duration_s < self.whole_s - SHORTEST_CUT_S).then_some(self.whole_s)
    }

    /// The motion's time, s.
    pub(super) fn motion_time_s(&self, t_s: f64) -> f64 {
        let t_s = t_s * self.speed;
        let ramped = |t_s: f64| self.ramp_s * minimum_jerk_integral(t_s / self.ramp_s);
        let to_stop_s = self.stopped_s - t_s;
        if t_s < self.ramp_s {
            ramped(t_s)
        } else if to_stop_s < self.ramp_s {
            self.stopped_s - self.ramp_s - ramped(to_stop_s)
        } else {
            t_s - self.ramp_s / 2.0
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_motion_is_played_to_its_end_and_held_there() {
        let table = [
            (3.0, 3.5, 3.0),
            (3.0, 5.0, 3.0),
            (3.0, 2.0, 1.5),
            (0.1, 1.0, 0.1),
            (3.0, 0.2, 0.1),
            (0.1, 0.15, 0.075),
        ];
        for (length_s, duration_s, end_s) in table {
            let clock = MotionClock::new(length_s, duration_s);
            assert!((clock.motion_time_s(duration_s) - end_s).abs() < 1e-12);
            assert!((clock.motion_time_s(duration_s + 9.0) - end_s).abs() < 1e-12);
            assert_eq!(clock.cut_from_s().is_some(), end_s < length_s);
            assert!(clock.motion_time_s(-1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_slowed_motion_passes_the_same_times_later() {
        let clock = MotionClock::new(3.0, 3.2);
        let slow = clock.slowed(0.1);
        assert!((slow.duration_s - 32.0).abs() < 1e-9);
        assert!(slow.cut_from_s().is_some_and(|whole_s| (whole_s - 35.0).abs() < 1e-9));
        for t_s in [0.1, 1.0, 3.0, 9.0] {
            assert!((slow.motion_time_s(10.0 * t_s) - clock.motion_time_s(t_s)).abs() < 1e-9);
        }
    }

    proptest! {
        /// Never backwards, never faster than real time, never a jump.
        #[test]
        fn the_clock_runs_between_standstill_and_real_time(
            length_s in 0.05..20.0f64, duration_s in 0.05..20.0f64, share in 0.0..1.0f64,
        ) {
            let clock = MotionClock::new(length_s, duration_s);
            let (t_s, step_s) = (share * duration_s, 1e-4);
            let passed_s = clock.motion_time_s(t_s + step_s) - clock.motion_time_s(t_s);
            prop_assert!((-1e-12..=step_s + 1e-12).contains(&passed_s));
        }
    }
}
