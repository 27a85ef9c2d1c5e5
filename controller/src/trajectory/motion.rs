//! A motion of the jaw on the platform, with a clock of its own. The clock starts and stops smoothly, so that any
//! motion starts and ends at rest on its unchanged path.

use masseter_model::geometry::{Mechanism, Pose};
use masseter_recorded_motion::{Recording, TrajectoryError, import, require};
use masseter_scenario::{JawConfig, MotionConfig, Scenario};

use super::generators::{Chewing, Excursion, minimum_jerk_integral};
use super::interpolate;
use super::mandible::JawFrame;

/// Time of the clock to full speed, and to a stop, s.
const RAMP_S: f64 = 0.5;

/// Largest difference of times by rounding, s.
const SHORTEST_CUT_S: f64 = 1e-6;

/// Duration of a generated motion without `duration_s`, s.
const GENERATED_DURATION_S: f64 = 10.0;

/// The desired pose of the platform as a function of time.
///
/// ```
/// use masseter_controller::trajectory::Trajectory;
/// use masseter_scenario::{JawConfig, MotionConfig};
/// use masseter_model::geometry::{Mechanism, MechanismConfig};
///
/// let mechanism = Mechanism::new(&MechanismConfig::default())?;
/// let chewing = Trajectory::new(&MotionConfig::default(), &JawConfig::default(), &mechanism, Some(5.0))?;
/// assert!(chewing.pose(0.3).translation.z < chewing.pose(0.0).translation.z);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Trajectory {
    motion: Motion,
    clock: MotionClock,
    frame: JawFrame,
}

#[derive(Debug, Clone)]
enum Motion {
    Chewing(Chewing),
    Excursion(Excursion),
    Recording(Recording),
}

impl Trajectory {
    /// Builds the motion. `duration_s` cuts it or holds its last pose; by default a generator runs
    /// for 10 s and a recording to its end.
    ///
    /// # Errors
    /// For a value outside its range, an unusable file, or a missing closed pose.
    pub fn new(
        config: &MotionConfig,
        jaw: &JawConfig,
        mechanism: &Mechanism,
        duration_s: Option<f64>,
    ) -> Result<Self, TrajectoryError> {
        if let Some(duration_s) = duration_s {
            require("duration_s", duration_s, duration_s > 0.0, "above 0")?;
        }
        let frame = JawFrame::new(jaw, mechanism)?;
        let motion = match config {
            MotionConfig::Chewing(config) => Motion::Chewing(Chewing::new(config, jaw)?),
            MotionConfig::Opening(config) => Motion::Excursion(Excursion::opening(config, jaw)?),
            MotionConfig::Protrusion(config) => Motion::Excursion(Excursion::protrusion(config, jaw)?),
            MotionConfig::Lateral(config) => Motion::Excursion(Excursion::lateral(config, jaw)?),
            MotionConfig::File(config) => Motion::Recording(import(config, jaw)?),
        };
        let clock = motion.clock(duration_s);
        Ok(Self { motion, clock, frame })
    }

    /// The motion of a scenario, as a run plays it: slow in a run without force.
    ///
    /// # Errors
    /// Those of [`Self::new`].
    pub fn of_scenario(scenario: &Scenario, mechanism: &Mechanism) -> Result<Self, TrajectoryError> {
        let motion = Self::new(&scenario.motion, &scenario.jaw, mechanism, scenario.duration_s)?;
        Ok(motion.slowed(scenario.dry.speed_now()))
    }

    /// The motion at a share of its speed.
    #[must_use]
    pub fn slowed(mut self, speed: f64) -> Self {
        self.clock = self.clock.slowed(speed);
        self
    }

    /// The platform in the base frame `t_s` seconds after the start; at rest before 0 and after
    /// [`duration_s`](Self::duration_s).
    pub fn pose(&self, t_s: f64) -> Pose {
        self.pose_in_motion(self.motion_time_s(t_s))
    }

    /// The platform with a share of the jaw's way from its first pose.
    pub(crate) fn scaled_pose(&self, t_s: f64, amplitude: f64) -> Pose {
        if amplitude >= 1.0 {
            return self.pose(t_s);
        }
        let [first, there] =
            [0.0, self.motion_time_s(t_s)].map(|motion_s| self.motion.displacement(motion_s));
        self.frame.platform(&interpolate(&first, &there, amplitude))
    }

    /// The platform in the base frame at a time of the motion, s.
    pub fn pose_in_motion(&self, motion_s: f64) -> Pose {
        self.frame.platform(&self.motion.displacement(motion_s))
    }

    /// The platform in the base frame as a recording's rows have it, without the low-pass; none for a generator.
    pub fn recorded_pose(&self, motion_s: f64) -> Option<Pose> {
        Some(self.frame.platform(&self.recording()?.recorded(motion_s)))
    }

    /// The times of a recording's rows after one time of the motion and up to another, s; none of a generator.
    pub fn rows_between(&self, after_s: f64, to_s: f64) -> &[f64] {
        self.recording().map_or(&[], |recording| recording.rows_between(after_s, to_s))
    }

    /// Progress of the motion at an even pace, s, at the instant when the ramps have brought it this far.
    pub fn even_time_s(&self, motion_s: f64) -> f64 {
        self.clock.even_time_s(motion_s)
    }

    /// The platform in the base frame when the mouth is closed.
    pub fn closed_pose(&self) -> Pose {
        self.frame.platform(&Pose::identity())
    }

    /// Progress of the motion `t_s` seconds after the start, s: for a recording, the time since its first row. This
    /// time passes more slowly at the start and at the end of the motion.
    pub fn motion_time_s(&self, t_s: f64) -> f64 {
        self.clock.motion_time_s(t_s)
    }

    /// Duration of the trajectory, s.
    pub fn duration_s(&self) -> f64 {
        self.clock.duration_s
    }

    /// Time of the whole motion, s, if the duration cuts the motion: the motion then ends on its way.
    pub fn cut_from_s(&self) -> Option<f64> {
        self.clock.cut_from_s()
    }

    /// The largest turn of the jaw, degrees, if a recording of markers gives no incisal point and the turn makes their
    /// centroid a bad substitute.
    pub fn centroid_turn_deg(&self) -> Option<f64> {
        self.recording()?.centroid_turn_deg
    }

    /// The doubts about a recording, each with its line; none for a generator.
    pub fn doubts(&self) -> Vec<String> {
        self.recording().map_or_else(Vec::new, Recording::all_doubts)
    }

    /// File and line, `motion.csv:7`, of the recording nearest to a time of the trajectory; none for a generator.
    pub fn source_line(&self, t_s: f64) -> Option<String> {
        Some(self.recording()?.source_line(self.motion_time_s(t_s)))
    }

    fn recording(&self) -> Option<&Recording> {
        if let Motion::Recording(recording) = &self.motion { Some(recording) } else { None }
    }
}

impl Motion {
    /// Generators play whole cycles only, and so end closed. A duration shorter than one cycle is the exception.
    fn clock(&self, duration_s: Option<f64>) -> MotionClock {
        let cycle = match self {
            Self::Chewing(chewing) => &chewing.cycle,
            Self::Excursion(excursion) => &excursion.cycle,
            Self::Recording(recording) => {
                let length_s = recording.length_s();
                return MotionClock::new(length_s, duration_s.unwrap_or(length_s + RAMP_S));
            }
        };
        let duration_s = duration_s.unwrap_or(GENERATED_DURATION_S);
        MotionClock::new(cycle.whole_cycles_s(duration_s - RAMP_S), duration_s)
    }

    /// Displacement of the lower jaw from the closed pose, jaw frame.
    fn displacement(&self, motion_s: f64) -> Pose {
        match self {
            Self::Chewing(chewing) => chewing.displacement(motion_s),
            Self::Excursion(excursion) => excursion.displacement(motion_s),
            Self::Recording(recording) => recording.displacement(motion_s),
        }
    }
}

/// Maps the trajectory's time to the motion's time.
#[derive(Debug, Clone, Copy)]
struct MotionClock {
    /// Speed of the clock as a share of real time.
    speed: f64,
    ramp_s: f64,
    stopped_s: f64,
    duration_s: f64,
    /// Time of the motion to its end.
    whole_s: f64,
}

impl MotionClock {
    /// A clock for a motion of some length in a trajectory of some duration, both above 0.
    ///
    /// A ramp covers half its time, so a motion takes one ramp longer than its length. The last pose fills a longer
    /// duration; a shorter duration cuts the motion.
    fn new(length_s: f64, duration_s: f64) -> Self {
        let ramp_s = RAMP_S.min(length_s).min(duration_s / 2.0);
        let whole_s = length_s + RAMP_S.min(length_s);
        Self { speed: 1.0, ramp_s, stopped_s: duration_s.min(length_s + ramp_s), duration_s, whole_s }
    }

    /// The clock at a share of its speed.
    fn slowed(self, speed: f64) -> Self {
        Self {
            speed: self.speed * speed,
            duration_s: self.duration_s / speed,
            whole_s: self.whole_s / speed,
            ..self
        }
    }

    /// Time of the motion to its end, s, if the duration cuts the motion by more than rounding.
    fn cut_from_s(&self) -> Option<f64> {
        (self.duration_s < self.whole_s - SHORTEST_CUT_S).then_some(self.whole_s)
    }

    /// The motion's time at an even pace, s, when the clock shows this time. Halvings find the instant.
    fn even_time_s(&self, motion_s: f64) -> f64 {
        let (even, end_s) = (Self { speed: 1.0, ..*self }, self.stopped_s - self.ramp_s);
        if (self.ramp_s / 2.0..=end_s - self.ramp_s / 2.0).contains(&motion_s) {
            return motion_s;
        }
        let (mut before_s, mut after_s) = (0.0, self.stopped_s);
        for _ in 0..60 {
            let middle_s = f64::midpoint(before_s, after_s);
            if even.motion_time_s(middle_s) < motion_s { before_s = middle_s } else { after_s = middle_s }
        }
        (before_s - self.ramp_s / 2.0).clamp(0.0, end_s)
    }

    /// The motion's time, s.
    fn motion_time_s(&self, t_s: f64) -> f64 {
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

    #[test]
    fn the_ramps_lead_the_motion_from_an_even_pace_at_its_ends_alone() {
        let clock = MotionClock::new(3.0, 3.5);
        for (motion_s, even_s) in [(0.0, 0.0), (0.25, 0.25), (1.0, 1.0), (2.75, 2.75), (3.0, 3.0)] {
            assert!((clock.even_time_s(motion_s) - even_s).abs() < 1e-9, "{motion_s}");
        }
        let ramped_s = clock.motion_time_s(0.4);
        assert!((clock.even_time_s(ramped_s) - 0.15).abs() < 1e-9);
        assert!((clock.slowed(0.1).even_time_s(ramped_s) - 0.15).abs() < 1e-9);
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
