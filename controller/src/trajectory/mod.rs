//! Trajectories: the desired pose of the platform as a function of time.
//!
//! A trajectory is built once from a scenario (here files are read, motions solved and memory
//! allocated) and then evaluated in the loop, without allocation and without iteration. It comes
//! from a generator on a rigid mandible ([`MotionConfig`]'s kinds) or from a recording, starts and
//! ends at rest, and moves nothing by itself: [`check`] judges beforehand whether the mechanism can
//! follow it. The way of the rig to the first pose is not part of it.

mod axes;
mod check;
mod chewing;
mod clock;
mod error;
mod excursion;
mod glitches;
mod import;
mod interpolation;
mod jaw_frame;
mod likely_axes;
mod lowpass;
mod mandible;
mod markers;
mod plausibility;
mod pose_csv;
mod recorded_rows;
mod recording;
mod rhythm;
mod spline;
mod survey;
mod table;

use masseter_model::geometry::{Mechanism, Pose};
use masseter_scenario::{JawConfig, MotionConfig};

pub use check::{TrajectoryReport, check};
pub use error::TrajectoryError;
pub use glitches::Glitch;
pub use jaw_frame::{closed_jaw_points, closed_pose};
pub use survey::{Gap, PointFigures, Range, RecordingSurvey, StepFigures, SurveyRow, survey};

pub(crate) use interpolation::interpolate;
pub(crate) use rhythm::minimum_jerk;

use chewing::Chewing;
use clock::{MotionClock, RAMP_S};
use excursion::Excursion;
use jaw_frame::JawFrame;
use recording::Recording;

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
    /// When a value lies outside its range, the file cannot be used, or no closed pose exists.
    pub fn new(
        config: &MotionConfig,
        jaw: &JawConfig,
        mechanism: &Mechanism,
        duration_s: Option<f64>,
    ) -> Result<Self, TrajectoryError> {
        if let Some(duration_s) = duration_s {
            error::require("duration_s", duration_s, duration_s > 0.0, "above 0")?;
        }
        let frame = JawFrame::new(jaw, mechanism)?;
        let motion = match config {
            MotionConfig::Chewing(config) => Motion::Chewing(Chewing::new(config, jaw)?),
            MotionConfig::Opening(config) => Motion::Excursion(Excursion::opening(config, jaw)?),
            MotionConfig::Protrusion(config) => Motion::Excursion(Excursion::protrusion(config, jaw)?),
            MotionConfig::Lateral(config) => Motion::Excursion(Excursion::lateral(config, jaw)?),
            MotionConfig::File(config) => Motion::Recording(import::import(config, jaw)?),
        };
        let clock = motion.clock(duration_s);
        Ok(Self { motion, clock, frame })
    }

    /// The same motion at a share of its speed.
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

    /// The same with a share of the jaw's way from its first pose.
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

    /// The platform in the base frame when the mouth is closed.
    pub(crate) fn closed_pose(&self) -> Pose {
        self.frame.platform(&Pose::identity())
    }

    /// How far the motion has come `t_s` seconds after the start, s: of a recording, the time since its first row. It
    /// passes more slowly while the motion gathers speed and while it comes to rest.
    pub fn motion_time_s(&self, t_s: f64) -> f64 {
        self.clock.motion_time_s(t_s)
    }

    /// How long the trajectory lasts, s.
    pub fn duration_s(&self) -> f64 {
        self.clock.duration_s
    }

    /// How long the whole motion would take, s, where the duration cuts it: it then ends somewhere on its way.
    pub fn cut_from_s(&self) -> Option<f64> {
        self.clock.cut_from_s()
    }

    /// The largest turn of the jaw, degrees, if a recording of markers gives no incisal point and the turn makes their
    /// centroid a bad substitute.
    pub fn centroid_turn_deg(&self) -> Option<f64> {
        let Motion::Recording(recording) = &self.motion else { return None };
        recording.centroid_turn_deg
    }

    /// What is doubtful in a recording, each with its line; nothing for a generator.
    pub fn doubts(&self) -> Vec<String> {
        let Motion::Recording(recording) = &self.motion else { return Vec::new() };
        recording.doubts.iter().cloned().chain(plausibility::jumps(&recording.glitches)).collect()
    }

    /// File and line, `motion.csv:7`, of the recording nearest to a time of the trajectory; none for a generator.
    pub fn source_line(&self, t_s: f64) -> Option<String> {
        let Motion::Recording(recording) = &self.motion else { return None };
        Some(recording.source_line(self.motion_time_s(t_s)))
    }
}

impl Motion {
    /// Generators play whole cycles only, so that they end closed, but for a duration in which not even one fits.
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

#[cfg(test)]
mod tests;
