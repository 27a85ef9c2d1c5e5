//! Inverse kinematics in closed form: dᵢ = (Aᵢ − Bᵢ⁰)·ûᵢ, lᵢ and θᵢ from the part of Aᵢ − Bᵢ
//! perpendicular to ûᵢ. Strokes are not checked here: see [`StrokeLimits`](super::StrokeLimits).

use super::{Actuators, Joints, LEGS, Mechanism, Pose};

/// A leg shorter than this has no direction.
const SHORTEST_LEG_M: f64 = 1e-9;

/// A pose without joint coordinates.
#[doc(alias = "IK")]
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum InverseError {
    /// The pose holds a value that is no finite number.
    #[error("the pose holds a value that is not a finite number")]
    NotFinite,
    /// Platform corner and hinge coincide, so the leg's angle is undefined.
    #[error("leg {leg} has no length ({leg_m:e} m): its angle is undefined")]
    NoLength {
        /// Index of the leg, from 0.
        leg: usize,
        /// Its length.
        leg_m: f64,
    },
}

impl Mechanism {
    /// Joint coordinates that hold the platform at `pose` (platform in the base frame, metres): metres, and angles in
    /// (−π, π].
    ///
    /// ```
    /// use masseter_shared::geometry::{Mechanism, MechanismConfig, Pose};
    ///
    /// let mechanism = Mechanism::new(&MechanismConfig::default())?;
    /// let joints = mechanism.inverse(&Pose::translation(0.0, 0.0, 0.268_452_355))?;
    /// assert!((joints.actuators.leg_m[0] - 0.27).abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`InverseError`] for a pose that is not finite, and where a corner lies on its slide's hinge.
    #[doc(alias("inverse kinematics", "IK"))]
    pub fn inverse(&self, pose: &Pose) -> Result<Joints, InverseError> {
        let mut joints = Joints {
            actuators: Actuators { slide_m: [0.0; LEGS], leg_m: [0.0; LEGS] },
            theta_rad: [0.0; LEGS],
        };
        for (leg, corner) in self.corners_at(pose).iter().enumerate() {
            let slide = &self.slides[leg];
            let from_centre = corner - slide.centre;
            let horizontal = from_centre.dot(&slide.inward);
            let leg_m = horizontal.hypot(from_centre.z);
            if !from_centre.iter().all(|x| x.is_finite()) {
                return Err(InverseError::NotFinite);
            }
            if leg_m < SHORTEST_LEG_M {
                return Err(InverseError::NoLength { leg, leg_m });
            }
            joints.actuators.slide_m[leg] = from_centre.dot(&slide.along);
            joints.actuators.leg_m[leg] = leg_m;
            joints.theta_rad[leg] = from_centre.z.atan2(horizontal);
        }
        Ok(joints)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::{MechanismConfig, SlideConfig, Vec3, frame_of_corners};

    /// Any mechanism a builder could declare, not only the paper's.
    fn mechanisms() -> impl Strategy<Value = Mechanism> {
        let slide = |azimuth: f64| {
            (0.04..0.09f64, -15.0..15.0f64, -10.0..10.0f64).prop_map(move |(radius, shift, skew)| {
                let (sin, cos) = (azimuth + shift).to_radians().sin_cos();
                SlideConfig {
                    centre_m: [radius * cos, radius * sin],
                    azimuth_deg: azimuth + shift + 90.0 + skew,
                }
            })
        };
        let sides = [0.045..0.06f64, 0.045..0.06f64, 0.045..0.06f64];
        (slide(0.0), slide(120.0), slide(240.0), sides).prop_map(|(s1, s2, s3, platform_sides_m)| {
            let config = MechanismConfig { slides: [s1, s2, s3], platform_sides_m, ..Default::default() };
            Mechanism::new(&config).unwrap()
        })
    }

    fn poses() -> impl Strategy<Value = Pose> {
        let position = [-0.05..0.05f64, -0.05..0.05f64, 0.15..0.35f64];
        let rotation = [-0.7..0.7f64, -0.7..0.7f64, -0.7..0.7f64];
        (position, rotation).prop_map(|([x, y, z], rotation)| {
            let rotation = UnitQuaternion::from_scaled_axis(Vec3::from(rotation));
            Pose::from_parts(Translation3::new(x, y, z), rotation)
        })
    }

    proptest! {
        /// Each loop closes: hinge plus leg ends at the platform's corner.
        #[test]
        fn joint_coordinates_close_the_loops(mechanism in mechanisms(), pose in poses()) {
            let joints = mechanism.inverse(&pose).unwrap();
            let rebuilt = mechanism.corners_from_angles(&joints.actuators, &joints.theta_rad);
            for (rebuilt, corner) in rebuilt.iter().zip(mechanism.corners_at(&pose)) {
                prop_assert!((rebuilt - corner).norm() < 1e-12);
            }
        }

        /// The corners that the joint coordinates place give back the pose they came from.
        #[test]
        fn pose_survives_the_way_through_the_corners(mechanism in mechanisms(), pose in poses()) {
            let again = frame_of_corners(&mechanism.corners_at(&pose));
            prop_assert!((again.translation.vector - pose.translation.vector).norm() < 1e-12);
            prop_assert!(again.rotation.angle_to(&pose.rotation) < 1e-7);
        }
    }

    #[test]
    fn neutral_pose_of_the_paper() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let pose = Pose::translation(0.0, 0.0, 0.268_452_355_053_9);
        let joints = mechanism.inverse(&pose).unwrap();
        for leg in 0..LEGS {
            assert!(joints.actuators.slide_m[leg].abs() < 1e-12);
            assert!((joints.actuators.leg_m[leg] - 0.27).abs() < 1e-9);
            assert!((joints.theta_rad[leg].to_degrees() - 83.862_391_93).abs() < 1e-7);
        }
    }

    #[test]
    fn a_pose_that_is_not_finite_is_refused() {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let pose = Pose::translation(f64::NAN, 0.0, 0.27);
        assert_eq!(mechanism.inverse(&pose), Err(InverseError::NotFinite));
    }
}
