//! The way between two poses.

use masseter_model::geometry::Pose;
use nalgebra::UnitQuaternion;

/// The pose at a share of the way from one pose to another: position and turn by as much.
pub(crate) fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = from.rotation.rotation_to(&to.rotation).scaled_axis() * share;
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    Pose::from_parts(position.into(), UnitQuaternion::from_scaled_axis(turn) * from.rotation)
}
