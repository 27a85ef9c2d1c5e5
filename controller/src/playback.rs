//! Where the motion stands: the move to its first pose, the motion itself, and coming to rest when
//! it is stopped halfway. Time comes in as the steps that the motion makes, so that it waits while the drives cannot follow.

use std::sync::Arc;

use masseter_shared::geometry::Pose;

use crate::trajectory::{Trajectory, minimum_jerk};

/// Which part is being played.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Part {
    /// Standing at a pose.
    Hold(Pose),
    /// From a pose to the first one of the motion.
    Ease(Pose),
    /// The motion.
    Motion,
}

/// The pose wanted, as a function of the time since playing began.
#[derive(Debug, Clone)]
pub(crate) struct Playback {
    /// Shared, so that a copy of the playback is made without allocation.
    trajectory: Arc<Trajectory>,
    ease_s: f64,
    stop_ramp_s: f64,
    part: Part,
    elapsed_s: f64,
    /// Speed of the part's own clock: 1, or less while it comes to rest.
    rate: f64,
    stopping: bool,
    /// Poses of the part that were worked out in advance.
    foreseen: [Option<Foreseen>; FORESEEN],
}

/// How many poses are worked out in advance.
const FORESEEN: usize = 2;

#[derive(Debug, Clone, Copy)]
struct Foreseen {
    time_s: f64,
    pose: Pose,
}

impl Playback {
    pub(crate) fn new(trajectory: Trajectory, ease_s: f64, stop_ramp_s: f64) -> Self {
        let part = Part::Hold(trajectory.pose(0.0));
        Self {
            trajectory: Arc::new(trajectory),
            ease_s,
            stop_ramp_s,
            part,
            elapsed_s: 0.0,
            rate: 1.0,
            stopping: false,
            foreseen: [None; FORESEEN],
        }
    }

    /// Stands at `pose`.
    pub(crate) fn hold(&mut self, pose: Pose) {
        self.begin(Part::Hold(pose));
    }

    /// Begins the move from where it stands to the first pose of the motion.
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
        self.foreseen = [None; FORESEEN];
    }

    /// Lets `dt_s` pass.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        (self.elapsed_s, self.rate) = self.advanced(dt_s);
    }

    /// Elapsed time and rate when `dt_s` will have passed.
    fn advanced(&self, dt_s: f64) -> (f64, f64) {
        let before = self.rate;
        let rate = if self.stopping { (before - dt_s / self.stop_ramp_s).max(0.0) } else { before };
        (self.elapsed_s + dt_s * (before + rate) / 2.0, rate)
    }

    /// The part's own time `ahead_s` from now, s.
    fn time_ahead_s(&self, ahead_s: f64) -> f64 {
        self.elapsed_s + self.rate * ahead_s
    }

    /// Works out the poses that will be wanted `ahead_s` from when `dt_s` will have passed. They do not depend on
    /// anything measured; where the motion goes on otherwise, they are not used.
    pub(crate) fn foresee(&mut self, dt_s: f64, ahead_s: [f64; FORESEEN]) {
        let (elapsed_s, rate) = self.advanced(dt_s);
        self.foreseen = ahead_s.map(|ahead_s| {
            let time_s = elapsed_s + rate * ahead_s;
            Some(Foreseen { time_s, pose: self.pose_at(time_s) })
        });
    }

    /// The pose wanted `ahead_s` from now.
    pub(crate) fn pose_ahead(&self, ahead_s: f64) -> Pose {
        let time_s = self.time_ahead_s(ahead_s);
        self.foreseen_at(time_s).unwrap_or_else(|| self.pose_at(time_s))
    }

    /// The pose at exactly that time of the part's own, if it was foreseen.
    fn foreseen_at(&self, time_s: f64) -> Option<Pose> {
        let foreseen =
            self.foreseen.iter().flatten().find(|foreseen| foreseen.time_s.total_cmp(&time_s).is_eq());
        foreseen.map(|foreseen| foreseen.pose)
    }

    /// The pose at a time of the part's own.
    fn pose_at(&self, time_s: f64) -> Pose {
        match self.part {
            Part::Hold(pose) => pose,
            Part::Ease(from) => {
                interpolate(&from, &self.trajectory.pose(0.0), minimum_jerk(time_s / self.ease_s))
            }
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

    /// Whether the pose wanted no longer changes.
    pub(crate) fn is_at_rest(&self) -> bool {
        self.is_over() || self.rate == 0.0
    }

    /// How far the motion has come `ahead_s` from now, as [`Trajectory::motion_time_s`] tells; negative before it
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
