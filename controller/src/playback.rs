//! Progress of the motion: the move to its first pose, the motion itself, and the ramp to rest when
//! it is stopped halfway. Time comes in as the steps of the motion, so that the motion waits while the drives cannot follow.
//! Rate and amplitude of the motion may change while it plays.

use masseter_model::geometry::Pose;
use masseter_scenario::MotionConfig;

use crate::slew::Slew;
use crate::trajectory::{Trajectory, interpolate, minimum_jerk};

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
    /// Speed of everything: 1, or less while the part comes to rest.
    rate: f64,
    /// Speed of the motion's own clock beside that.
    tempo: Slew,
    /// Share of the motion's way that is played.
    amplitude: Slew,
    /// For how long the motion plays, s.
    played_s: f64,
    stopping: bool,
}

impl Playback {
    /// A change of rate or amplitude by 1 takes `change_s`.
    pub(crate) fn new(trajectory: Trajectory, ease_s: f64, stop_ramp_s: f64, change_s: f64) -> Self {
        Self {
            part: Part::Hold(trajectory.pose(0.0)),
            trajectory,
            ease_s,
            stop_ramp_s,
            elapsed_s: 0.0,
            rate: 1.0,
            tempo: Slew::of(change_s),
            amplitude: Slew::of(change_s),
            played_s: 0.0,
            stopping: false,
        }
    }

    /// Sets the rate of the motion, 0 to 1.
    pub(crate) fn set_motion_rate(&mut self, rate: f64) {
        self.tempo.set(rate);
    }

    /// Sets the share of the way from the motion's first pose that is played, 0 to 1.
    pub(crate) fn set_motion_amplitude(&mut self, amplitude: f64) {
        self.amplitude.set(amplitude);
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
        // No part begins on the motion's way, so neither moves anything.
        self.tempo.jump();
        self.amplitude.jump();
        self.played_s = 0.0;
    }

    /// Lets `dt_s` pass.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        let (before, speed_before) = (self.rate, self.speed());
        if self.stopping {
            self.rate = (before - dt_s / self.stop_ramp_s).max(0.0);
        }
        if self.part == Part::Motion {
            self.played_s += dt_s;
            // A stop also slows these changes down, so that the pose keeps its course while it comes to rest.
            let passed_s = dt_s * (before + self.rate) / 2.0;
            self.tempo.advance(passed_s);
            self.amplitude.advance(passed_s);
        }
        self.elapsed_s += dt_s * (speed_before + self.speed()) / 2.0;
    }

    /// Speed of the part's own clock.
    fn speed(&self) -> f64 {
        if self.part == Part::Motion { self.rate * self.tempo.value } else { self.rate }
    }

    /// The part's own time `ahead_s` from now, s.
    fn time_ahead_s(&self, ahead_s: f64) -> f64 {
        self.elapsed_s + self.speed() * ahead_s
    }

    /// The desired pose `ahead_s` from now.
    pub(crate) fn pose_ahead(&self, ahead_s: f64) -> Pose {
        let time_s = self.time_ahead_s(ahead_s);
        match self.part {
            Part::Hold(pose) => pose,
            Part::Ease(from) => interpolate(&from, &self.first_pose(), minimum_jerk(time_s / self.ease_s)),
            Part::Motion => self.trajectory.scaled_pose(time_s, self.amplitude.ahead(self.rate * ahead_s)),
        }
    }

    /// Whether the current part has reached its end, or a motion has taken too long.
    pub(crate) fn is_over(&self) -> bool {
        let most_s = MotionConfig::MOST_DURATIONS * self.trajectory.duration_s();
        self.is_at_end() || (self.part == Part::Motion && self.played_s >= most_s)
    }

    fn is_at_end(&self) -> bool {
        match self.part {
            Part::Hold(_) => true,
            Part::Ease(_) => self.elapsed_s >= self.ease_s,
            Part::Motion => self.elapsed_s >= self.trajectory.duration_s(),
        }
    }

    /// Whether the desired pose no longer changes.
    pub(crate) fn is_at_rest(&self) -> bool {
        let is_changing = self.part == Part::Motion && !self.amplitude.is_settled();
        self.rate == 0.0 || (self.is_at_end() && !is_changing)
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

#[cfg(test)]
mod tests;
