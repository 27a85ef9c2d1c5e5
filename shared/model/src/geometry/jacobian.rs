//! The Jacobian from the platform's twist to joint rates.

use nalgebra::{Matrix3x6, Matrix6, Vector6};

use super::{Joints, LEGS, Legs, Mechanism, Pose, Vec3};

/// Twist of the platform in the base frame: velocity of its origin (m/s), then angular velocity (rad/s).
#[doc(alias("spatial velocity", "velocity screw"))]
pub type Twist = Vector6<f64>;

/// Joint rates as linear functions of the platform's [`Twist`], at one pose.
#[doc(alias("velocity Jacobian", "inverse Jacobian"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Jacobian {
    /// Rows d₁ d₂ d₃ l₁ l₂ l₃: q̇ = `actuators` · twist; m/s per m/s, m/s per rad/s.
    pub actuators: Matrix6<f64>,
    /// Rows θ₁ θ₂ θ₃: θ̇ = `hinges` · twist; rad/s.
    pub hinges: Matrix3x6<f64>,
    /// Side A₁A₂ of the platform.
    length_m: f64,
}

impl Jacobian {
    /// The Jacobian at a pose and its joint coordinates (of [`Mechanism::inverse`]).
    ///
    /// # Examples
    /// ```
    /// use masseter_model::geometry::{Jacobian, Mechanism, MechanismConfig, Pose, Twist};
    ///
    /// let mechanism = Mechanism::new(&MechanismConfig::default())?;
    /// let pose = Pose::translation(0.0, 0.0, 0.268_452_355);
    /// let jacobian = Jacobian::new(&mechanism, &pose, &mechanism.inverse(&pose)?);
    /// let upwards = Twist::new(0.0, 0.0, 0.01, 0.0, 0.0, 0.0);
    /// let rates_m_s = jacobian.actuators * upwards;
    /// assert!(rates_m_s[0].abs() < 1e-12, "the slides stand still");
    /// assert!((rates_m_s[3] - 0.00994).abs() < 1e-5, "the legs extend");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(mechanism: &Mechanism, pose: &Pose, joints: &Joints) -> Self {
        Self::of_legs(
            mechanism,
            &Legs {
                actuators: joints.actuators,
                sin_cos: joints.theta_rad.map(f64::sin_cos),
                arms_m: mechanism.platform_corners().map(|corner| pose.rotation * corner),
            },
        )
    }

    /// The Jacobian where the legs' directions are known (of [`Mechanism::legs`]).
    pub fn of_legs(mechanism: &Mechanism, legs: &Legs) -> Self {
        let mut jacobian = Self {
            actuators: Matrix6::zeros(),
            hinges: Matrix3x6::zeros(),
            length_m: mechanism.platform_sides_m()[0],
        };
        for (leg, &(sin, cos)) in legs.sin_cos.iter().enumerate() {
            let arm = legs.arms_m[leg];
            let inward = mechanism.inward_direction(leg);
            let along_leg = inward * cos + Vec3::z() * sin;
            let across_leg = Vec3::z() * cos - inward * sin;
            let rate_along = |direction: &Vec3| {
                let moment = arm.cross(direction);
                Vector6::new(direction.x, direction.y, direction.z, moment.x, moment.y, moment.z).transpose()
            };
            jacobian.actuators.set_row(leg, &rate_along(&mechanism.slide_direction(leg)));
            jacobian.actuators.set_row(LEGS + leg, &rate_along(&along_leg));
            jacobian.hinges.set_row(leg, &(rate_along(&across_leg) / legs.actuators.leg_m[leg]));
        }
        jacobian
    }

    /// The actuators' rates with all columns as velocities.
    pub(super) fn scaled(&self) -> Matrix6<f64> {
        let mut scaled = self.actuators;
        scaled.fixed_columns_mut::<3>(3).scale_mut(1.0 / self.length_m);
        scaled
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion};
    use proptest::prelude::*;

    use super::*;
    use crate::geometry::MechanismConfig;

    fn moved(pose: &Pose, twist: &Twist, seconds: f64) -> Pose {
        let linear = twist.fixed_rows::<3>(0) * seconds;
        let angular = twist.fixed_rows::<3>(3) * seconds;
        Pose::from_parts(
            Translation3::from(pose.translation.vector + linear),
            UnitQuaternion::from_scaled_axis(angular) * pose.rotation,
        )
    }

    proptest! {
        /// Central differences of the inverse kinematics agree with every row.
        #[test]
        fn rates_are_the_derivative_of_the_inverse(
            at in [-0.03..0.03f64, -0.03..0.03f64, 0.24..0.3f64],
            turn in [-0.5..0.5f64, -0.5..0.5f64, -0.5..0.5f64],
            twist in [-0.2..0.2f64, -0.2..0.2f64, -0.2..0.2f64, -2.0..2.0f64, -2.0..2.0f64, -2.0..2.0f64],
        ) {
            let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
            let pose = Pose::from_parts(
                Translation3::new(at[0], at[1], at[2]),
                UnitQuaternion::from_scaled_axis(Vec3::from(turn)),
            );
            let twist = Twist::from(twist);
            let jacobian = Jacobian::new(&mechanism, &pose, &mechanism.inverse(&pose).unwrap());
            let h = 1e-6;
            let before = mechanism.inverse(&moved(&pose, &twist, -h)).unwrap();
            let after = mechanism.inverse(&moved(&pose, &twist, h)).unwrap();
            let rates = jacobian.actuators * twist;
            let hinge_rates = jacobian.hinges * twist;
            for axis in 0..6 {
                let difference = after.actuators.to_axes()[axis] - before.actuators.to_axes()[axis];
                prop_assert!((difference / (2.0 * h) - rates[axis]).abs() < 1e-6);
            }
            for leg in 0..LEGS {
                let difference = after.theta_rad[leg] - before.theta_rad[leg];
                prop_assert!((difference / (2.0 * h) - hinge_rates[leg]).abs() < 1e-6);
            }
        }
    }
}
