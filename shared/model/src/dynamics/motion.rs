//! Pose and twist of the platform, with all that kinematics makes of them.

use nalgebra::{Vector3, Vector6};

use crate::geometry::{InverseError, Jacobian, LEGS, Legs, Mechanism, Pose, Twist, Vec3};

/// A motion of the mechanism at an instant: positions and rates of platform and joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The platform in the base frame.
    pub pose: Pose,
    /// Twist V of the platform's origin, base axes, m/s and rad/s.
    pub twist: Twist,
    /// Positions of slides and legs, and the legs' directions.
    pub legs: Legs,
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
        let legs = mechanism.legs(pose)?;
        let jacobian = Jacobian::of_legs(mechanism, &legs);
        let (rates_m_s, swings_rad_s) = (jacobian.actuators * twist, jacobian.hinges * twist);
        let still = JointAccelerations { axes_m_s2: Vector6::zeros(), hinges_rad_s2: Vector3::zeros() };
        let mut motion =
            Self { pose: *pose, twist: *twist, legs, jacobian, rates_m_s, swings_rad_s, bias: still };
        motion.bias = motion.bias_of();
        Ok(motion)
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
    fn bias_of(&self) -> JointAccelerations {
        let (omega, mut bias) = (self.omega(), self.bias);
        let along_axes = self.jacobian.actuators.fixed_columns::<3>(0);
        let about_hinges = self.jacobian.hinges.fixed_columns::<3>(0);
        for (leg, arm) in self.legs.arms_m.iter().enumerate() {
            let corner = omega.cross(&omega.cross(arm));
            let (leg_m, swing) = (self.legs.actuators.leg_m[leg], self.swings_rad_s[leg]);
            let stretch = self.rates_m_s[LEGS + leg];
            bias.axes_m_s2[leg] = (along_axes.row(leg) * corner).x;
            bias.axes_m_s2[LEGS + leg] = (along_axes.row(LEGS + leg) * corner).x + leg_m * swing * swing;
            bias.hinges_rad_s2[leg] = (about_hinges.row(leg) * corner).x - 2.0 * stretch * swing / leg_m;
        }
        bias
    }
}
