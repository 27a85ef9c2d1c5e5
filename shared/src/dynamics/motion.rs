//! Pose and twist of the platform, with all that kinematics makes of them.

use nalgebra::{Vector3, Vector6};

use crate::geometry::{InverseError, Jacobian, Joints, LEGS, Mechanism, Pose, Twist, Vec3};

/// A motion of the mechanism at an instant: positions and rates of platform and joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The platform in the base frame.
    pub pose: Pose,
    /// Twist V of the platform's origin, base axes, m/s and rad/s.
    pub twist: Twist,
    /// Positions of slides, legs and hinges.
    pub joints: Joints,
    /// Sines and cosines of the hinges' angles, which Jacobian, equations and reactions share.
    pub(super) sin_cos: [(f64, f64); LEGS],
    /// Joint rates as linear functions of the twist.
    pub jacobian: Jacobian,
    /// Rates of the axes d₁ d₂ d₃ l₁ l₂ l₃, m/s.
    pub rates_m_s: Vector6<f64>,
    /// Rates of the hinges θ₁ θ₂ θ₃, rad/s.
    pub swings_rad_s: Vector3<f64>,
    /// J̇V: the joints' accelerations while the twist stays constant.
    pub bias: JointAccelerations,
}

/// Accelerations of the joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointAccelerations {
    /// Of the axes d₁ d₂ d₃ l₁ l₂ l₃, m/s².
    pub axes_m_s2: Vector6<f64>,
    /// Of the hinges θ₁ θ₂ θ₃, rad/s².
    pub hinges_rad_s2: Vector3<f64>,
}

impl Motion {
    /// The motion at a pose and a twist of the platform.
    ///
    /// # Errors
    /// [`InverseError`] for a pose without joint coordinates.
    pub fn new(mechanism: &Mechanism, pose: &Pose, twist: &Twist) -> Result<Self, InverseError> {
        Ok(Self::of_joints(mechanism, pose, &mechanism.inverse(pose)?, twist))
    }

    /// The same where the joint coordinates of the pose (of [`Mechanism::inverse`]) are known.
    pub fn of_joints(mechanism: &Mechanism, pose: &Pose, joints: &Joints, twist: &Twist) -> Self {
        let sin_cos = joints.theta_rad.map(f64::sin_cos);
        let jacobian = Jacobian::with_sin_cos(mechanism, pose, joints, &sin_cos);
        let (rates_m_s, swings_rad_s) = (jacobian.actuators * twist, jacobian.hinges * twist);
        let still = JointAccelerations { axes_m_s2: Vector6::zeros(), hinges_rad_s2: Vector3::zeros() };
        let mut motion = Self {
            pose: *pose,
            twist: *twist,
            joints: *joints,
            sin_cos,
            jacobian,
            rates_m_s,
            swings_rad_s,
            bias: still,
        };
        motion.bias = motion.bias_of(mechanism.platform_corners());
        motion
    }

    /// Accelerations of the joints while the twist changes by that much a second, m/s² and rad/s²: J V̇ + J̇V.
    pub fn accelerations(&self, acceleration: &Twist) -> JointAccelerations {
        JointAccelerations {
            axes_m_s2: self.jacobian.actuators * acceleration + self.bias.axes_m_s2,
            hinges_rad_s2: self.jacobian.hinges * acceleration + self.bias.hinges_rad_s2,
        }
    }

    /// The platform's angular velocity ω in base axes, rad/s.
    pub(super) fn omega(&self) -> Vec3 {
        self.twist.fixed_rows::<3>(3).into()
    }

    /// Under a constant twist a corner is accelerated by ω×(ω×r) alone. Slide and leg see their component of this vector,
    /// the leg also the centrifugal lθ̇², the hinge the Coriolis −2l̇θ̇/l. The first three columns of a row of the Jacobian
    /// are the direction to project on.
    fn bias_of(&self, corners: &[Vec3; LEGS]) -> JointAccelerations {
        let (omega, mut bias) = (self.omega(), self.bias);
        let along_axes = self.jacobian.actuators.fixed_columns::<3>(0);
        let about_hinges = self.jacobian.hinges.fixed_columns::<3>(0);
        for (leg, corner) in corners.iter().enumerate() {
            let corner = omega.cross(&omega.cross(&(self.pose.rotation * corner)));
            let (leg_m, swing) = (self.joints.actuators.leg_m[leg], self.swings_rad_s[leg]);
            let stretch = self.rates_m_s[LEGS + leg];
            bias.axes_m_s2[leg] = (along_axes.row(leg) * corner).x;
            bias.axes_m_s2[LEGS + leg] = (along_axes.row(LEGS + leg) * corner).x + leg_m * swing * swing;
            bias.hinges_rad_s2[leg] = (about_hinges.row(leg) * corner).x - 2.0 * stretch * swing / leg_m;
        }
        bias
    }
}
