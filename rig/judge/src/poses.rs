//! Poses in messages, and how far they are apart. A pose with a value that is no number is infinitely far.

use masseter_controller::trajectory::closed_pose;
use masseter_model::geometry::{Deviation, Mechanism, Pose, Vec3};
use masseter_runtime::messages::codes::{ControllerState, DriveState};
use masseter_runtime::messages::{Reading, State, Truth, pose_from_fields};
use masseter_scenario::Scenario;

/// States in which the platform has a desired pose.
pub const MOVING: [ControllerState; 3] =
    [ControllerState::Easing, ControllerState::Running, ControllerState::Holding];

/// Whether the platform has a desired pose in this state of the controller, a code.
pub(super) fn is_moving(state: Option<u32>) -> bool {
    MOVING.iter().any(|moving| state == Some(moving.code()))
}

/// Whether all drives are enabled.
pub(super) fn are_enabled(reading: &Reading) -> bool {
    reading.drive_state.iter().all(|code| *code == DriveState::OperationEnabled.code())
}

pub(super) fn is_running(state: Option<u32>) -> bool {
    state == Some(ControllerState::Running.code())
}

/// The platform when the jaw is closed; none for a scenario without that pose, which no run has.
pub(super) fn closed_platform(scenario: &Scenario) -> Option<Pose> {
    closed_pose(&scenario.jaw, &Mechanism::new(&scenario.mechanism).ok()?).ok()
}

pub(super) fn desired_pose(state: &State) -> Option<Pose> {
    pose(state.desired_position_m, state.desired_quaternion_wxyz)
}

pub(super) fn estimated_pose(state: &State) -> Option<Pose> {
    pose(state.estimated_position_m, state.estimated_quaternion_wxyz)
}

pub(super) fn true_pose(truth: &Truth) -> Option<Pose> {
    pose(truth.position_m, truth.quaternion_wxyz)
}

/// A quaternion's length may differ from 1 by so much: single precision and more.
const LENGTH_TOLERANCE: f64 = 1e-3;

/// The pose in a message; `None` if a number is not finite or the quaternion is no rotation.
fn pose(position_m: [f64; 3], quaternion_wxyz: [f64; 4]) -> Option<Pose> {
    let length = quaternion_wxyz.iter().map(|part| part * part).sum::<f64>().sqrt();
    let is_pose = position_m.iter().all(|x| x.is_finite()) && (length - 1.0).abs() <= LENGTH_TOLERANCE;
    is_pose.then(|| pose_from_fields(position_m, quaternion_wxyz))
}

/// Where a point of the platform frame is, base frame, m.
pub(super) fn place(platform: &Pose, point_m: &Vec3) -> Vec3 {
    platform.translation.vector + platform.rotation * point_m
}

/// How a point moves from one pose to another, m.
pub(super) fn way(from: &Pose, to: &Pose, point_m: &Vec3) -> Vec3 {
    place(to, point_m) - place(from, point_m)
}

/// How the platform turns from one pose to another: an angle, rad, along its axis, base frame.
pub(super) fn turn(from: &Pose, to: &Pose) -> Vec3 {
    (to.rotation * from.rotation.inverse()).scaled_axis()
}

/// How far two poses are apart.
pub(super) fn deviation(a: Option<&Pose>, b: Option<&Pose>, incisal_m: [f64; 3]) -> Deviation {
    const NOWHERE: Deviation =
        Deviation { origin_m: f64::INFINITY, incisal_m: f64::INFINITY, angle_rad: f64::INFINITY };
    a.zip(b).map_or(NOWHERE, |(a, b)| Deviation::between(a, b, incisal_m))
}

/// The worse of two errors; NaN counts as infinite.
pub(super) fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::INFINITY } else { a.max(b) }
}
