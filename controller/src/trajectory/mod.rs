//! Trajectories: the desired pose of the platform as a function of time.
//!
//! The constructor builds a trajectory once from a scenario: it reads files, solves motions and allocates memory. The
//! loop evaluates the trajectory without allocation and without iteration. A trajectory comes from a generator on a
//! rigid mandible ([`MotionConfig`](masseter_scenario::MotionConfig)'s kinds) or from a recording, and starts and ends
//! at rest. [`check`] judges beforehand whether the mechanism can follow. The rig's way to the first pose is not part
//! of a trajectory.

mod check;
mod generators;
mod mandible;
mod motion;

use masseter_model::geometry::Pose;

pub use check::{TrajectoryReport, check};
pub(crate) use generators::minimum_jerk;
pub use mandible::{closed_jaw_points, closed_pose};
pub use masseter_recorded_motion::TrajectoryError;
pub use motion::Trajectory;

/// The pose at a share of the way from one pose to another, for position and turn.
pub(crate) fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = from.rotation.rotation_to(&to.rotation).scaled_axis() * share;
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    Pose::from_parts(position.into(), nalgebra::UnitQuaternion::from_scaled_axis(turn) * from.rotation)
}

#[cfg(test)]
mod tests;
