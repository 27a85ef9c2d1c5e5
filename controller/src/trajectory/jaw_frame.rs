//! From displacements of the lower jaw to poses of the platform.
//!
//! Platform = closed · X · T · X⁻¹, where X is the jaw frame in the platform frame at the closed pose:
//! origin at the incisal point, axes parallel to the base's.

use masseter_model::geometry::{Actuators, LEGS, Mechanism, Pose, Vec3};
use masseter_scenario::JawConfig;
use nalgebra::Translation3;

use crate::kinematics::solve_completely;

use super::TrajectoryError;
use super::error::require;
use super::mandible::condylar_middle;

/// Farthest offset on a robot that fits on a table, m.
const FARTHEST_M: f64 = 1.0;

/// The jaw on the platform.
#[derive(Debug, Clone, Copy)]
pub(super) struct JawFrame {
    /// closed · X: the jaw frame in the base frame.
    jaw: Pose,
    /// X⁻¹.
    platform_in_jaw: Pose,
}

impl JawFrame {
    pub(super) fn new(jaw: &JawConfig, mechanism: &Mechanism) -> Result<Self, TrajectoryError> {
        let closed = closed_pose(jaw, mechanism)?;
        let jaw_in_platform =
            Pose::from_parts(Translation3::from(jaw.reference_point_m), closed.rotation.inverse());
        Ok(Self { jaw: closed * jaw_in_platform, platform_in_jaw: jaw_in_platform.inverse() })
    }

    /// The platform in the base frame when the jaw is displaced from the closed pose.
    pub(super) fn platform(&self, displacement: &Pose) -> Pose {
        self.jaw * displacement * self.platform_in_jaw
    }
}

/// The platform in the base frame when the jaw is closed.
///
/// # Errors
/// When a value lies outside its range, or no such pose exists.
pub fn closed_pose(jaw: &JawConfig, mechanism: &Mechanism) -> Result<Pose, TrajectoryError> {
    let closed_leg_m = require("jaw.closed_leg_m", jaw.closed_leg_m, jaw.closed_leg_m > 0.0, "above 0")?;
    for (name, point) in
        [("jaw.reference_point_m", jaw.reference_point_m), ("jaw.closed_offset_m", jaw.closed_offset_m)]
    {
        for coordinate in point {
            require(name, coordinate, coordinate.abs() <= FARTHEST_M, "within ±1 m")?;
        }
    }
    let actuators = Actuators { slide_m: [0.0; LEGS], leg_m: [closed_leg_m; LEGS] };
    let no_pose = |error| {
        let problem = format!("jaw.closed_leg_m = {closed_leg_m:?} m gives no closed pose: {error}");
        TrajectoryError(problem)
    };
    let closed = solve_completely(mechanism, &actuators).map_err(no_pose)?.pose;
    Ok(Translation3::from(jaw.closed_offset_m) * closed)
}

/// Incisal point, right and left condyle in the platform frame, when the jaw is closed at that pose.
///
/// # Errors
/// When a dimension of the mandible lies outside its range.
pub fn closed_jaw_points(jaw: &JawConfig, closed: &Pose) -> Result<[Vec3; 3], TrajectoryError> {
    let middle = condylar_middle(jaw)?;
    let aside = Vec3::new(0.0, jaw.bonwill_side_m / 2.0, 0.0);
    let jaw_in_platform =
        Pose::from_parts(Translation3::from(jaw.reference_point_m), closed.rotation.inverse());
    Ok([Vec3::zeros(), middle - aside, middle + aside]
        .map(|point| jaw_in_platform.transform_point(&point.into()).coords))
}
