//! Progress of the motion: the move to its first pose, the motion itself, and the ramp to rest when
//! it is stopped halfway. Time comes in as the steps of the motion, so that the motion waits while the drives cannot follow.

use masseter_shared::geometry::Pose;

use crate::trajectory::{Trajectory, minimum_jerk};

/// The part that is playing.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    /// Holds a pose.
    Hold(Pose),
    /// From a pose to the first one of the motion.
    Ease(Pose),
    /// The motion.
    Motion,
}

/// The desired pose, as a function of the time since playing began.
#[derive(Debug)]
pub(crate) struct Playback {
    trajectory: Trajectory,
    ease_s: f64,
    stop_ramp_s: f64,
    part: Part,
    elapsed_s: f64,
    /// Speed of the part's own clock: 1, or less while it comes to rest.
    rate: f64,
    stopping: bool,
}

impl Playback {
    pub(crate) fn new(trajectory: Trajectory, ease_s: f64, stop_ramp_s: f64) -> Self {
        let part = Part::Hold(trajectory.pose(0.0));
        Self { trajectory, ease_s, stop_ramp_s, part, elapsed_s: 0.0, rate: 1.0, stopping: false }
    }

    /// The first pose of the motion.
    pub(crate) fn first_pose(&self) -> Pose {
        self.trajectory.pose(0.0)
    }

    /// Holds `pose`.
    pub(crate) fn hold(&mut self, pose: Pose) {
        self.begin(Part::Hold(pose));
    }

    /// Begins the move from the present pose to the first pose of the motion.
    pub(crate) fn ease(&mut self) {
        self.begin(Part::Ease(self.pose_ahead(0.0)));
    }

    /// Begins the motion.
    pub(crate) fn play(&mut self) {
        self.begin(Part::Motion);
    }

    /// Lets the part come to rest on its own path.
    pub(crate) fn stop(&mut self) {
        self.stopping = true;
    }

    fn begin(&mut self, part: Part) {
        (self.part, self.elapsed_s, self.rate, self.stopping) = (part, 0.0, 1.0, false);
    }

    /// Lets `dt_s` pass.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        let before = self.rate;
        if self.stopping {
            self.rate = (before - dt_s / self.stop_ramp_s).max(0.0);
        }
        self.elapsed_s += dt_s * (before + self.rate) / 2.0;
    }

    /// The part's own time `ahead_s` from now, s.
    fn time_ahead_s(&self, ahead_s: f64) -> f64 {
        self.elapsed_s + self.rate * ahead_s
    }

    /// The desired pose `ahead_s` from now.
    pub(crate) fn pose_ahead(&self, ahead_s: f64) -> Pose {
        let time_s = self.time_ahead_s(ahead_s);
        match self.part {
            Part::Hold(pose) => pose,
            Part::Ease(from) => interpolate(&from, &self.first_pose(), minimum_jerk(time_s / self.ease_s)),
            Part::Motion => self.trajectory.pose(time_s),
        }
    }

    /// Whether the current part has reached its end.
    pub(crate) fn is_over(&self) -> bool {
        match self.part {
            Part::Hold(_) => true,
            Part::Ease(_) => self.elapsed_s >= self.ease_s,
            Part::Motion => self.elapsed_s >= self.trajectory.duration_s(),
        }
    }

    /// Whether the desired pose no longer changes.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.is_over() || self.rate == 0.0
    }

    /// How far the motion has come `ahead_s` from now, in the sense of [`Trajectory::motion_time_s`]; negative before it
    /// begins.
    pub(crate) fn motion_time_ahead_s(&self, ahead_s: f64) -> f64 {
        if self.part == Part::Motion {
            self.trajectory.motion_time_s(self.time_ahead_s(ahead_s))
        } else {
            -1.0
        }
    }
}

fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = from.rotation.rotation_to(&to.rotation).scaled_axis() * share;
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    Pose::from_parts(position.into(), nalgebra::UnitQuaternion::from_scaled_axis(turn) * from.rotation)
}

#[cfg(test)]
mod tests;
