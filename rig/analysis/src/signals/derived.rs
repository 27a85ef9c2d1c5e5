//! Signals of the jaw that follow from poses: places of its points, opening, rotation, errors.

use masseter_model::geometry::{Pose, Vec3};
use masseter_recording::jaw_points;
use masseter_runtime::messages::{State, Truth};
use masseter_scenario::JawConfig;

use super::cycle::CycleMessages;
use crate::pose_errors::pose;

/// A point of the jaw.
#[derive(Debug, Clone, Copy)]
pub(super) enum JawPoint {
    Incisal,
    LeftCondyle,
    RightCondyle,
}

/// The jaw on the platform, and where its pose comes from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Jaw {
    /// Its points in the platform frame, m.
    points_m: [Vec3; 3],
    has_truth: bool,
}

impl Jaw {
    pub(super) fn new(jaw: &JawConfig, has_truth: bool) -> Self {
        Self { points_m: jaw_points(jaw), has_truth }
    }

    /// The pose that the jaw has: the true one where the mechanism is emulated, otherwise the estimated one.
    pub(super) fn actual(&self, messages: &CycleMessages) -> Option<Pose> {
        if !self.has_truth {
            return estimated(messages);
        }
        let Truth { position_m, quaternion_wxyz, .. } = messages.truth?;
        pose(position_m, quaternion_wxyz)
    }

    /// Where a point is in the base frame, m.
    pub(super) fn place(&self, point: JawPoint, pose: &Pose) -> Vec3 {
        pose.translation.vector + pose.rotation * self.points_m[point as usize]
    }

    /// How far a point is in one pose from where it is in another, m.
    pub(super) fn distance(&self, point: JawPoint, a: &Pose, b: &Pose) -> f64 {
        (self.place(point, a) - self.place(point, b)).norm()
    }
}

/// The pose that forward kinematics found.
pub(super) fn estimated(messages: &CycleMessages) -> Option<Pose> {
    let State { estimated_position_m, estimated_quaternion_wxyz, .. } = solution(messages)?;
    pose(estimated_position_m, estimated_quaternion_wxyz)
}

/// The pose that the jaw should have.
pub(super) fn desired(messages: &CycleMessages) -> Option<Pose> {
    let State { desired_position_m, desired_quaternion_wxyz, .. } = solution(messages)?;
    pose(desired_position_m, desired_quaternion_wxyz)
}

/// The state, where it was computed from the cycle's sample: only then are its poses those of the sample.
pub(super) fn solution(messages: &CycleMessages) -> Option<State> {
    messages.state.filter(|_| messages.has_solution)
}
