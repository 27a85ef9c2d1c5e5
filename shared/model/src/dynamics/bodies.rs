//! The rigid bodies (masses, centres of mass, inertias), and their motion with the quantities that kinematics derives
//! from it.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::parameters::DynamicsConfig;
use crate::geometry::{InverseError, Jacobian, LEGS, Legs, Mechanism, Pose, Twist, Vec3};

/// A part of a leg that turns with its hinge. Its centre of mass lies on the leg's axis, and the slide's direction û is a
/// principal axis of its inertia.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Link {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass on the leg's axis, m: above the hinge for the cylinder, behind the ball for the rod.
    pub centre_m: f64,
    /// Inertia about the centre of mass, for a turn about û, kg m².
    pub inertia_kg_m2: f64,
}

/// The platform with the lower jaw.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Platform {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the platform frame, m.
    pub centre_m: Vec3,
    /// Inertia about the centre of mass, platform axes, kg m².
    pub inertia_kg_m2: Matrix3<f64>,
}

/// The moving bodies of the mechanism, under gravity along −z of the base. All three legs are equal.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bodies {
    /// Carriage, kg: the slide moves the carriage without a turn. Its centre of mass is the hinge.
    pub carriage_kg: f64,
    /// Cylinder, which turns with the hinge.
    pub cylinder: Link,
    /// Rod, which turns with the hinge and slides in the cylinder.
    pub rod: Link,
    /// The platform.
    pub platform: Platform,
    /// Gravity, m/s².
    pub gravity_m_s2: f64,
}

/// The equations of one leg, cut off at the ball, in the order d, l, θ: Q = masses · q̈ + bias.
#[derive(Debug, Clone, Copy)]
pub(super) struct LegEquations {
    /// kg, kg, kg m².
    pub(super) masses: [f64; 3],
    /// Centrifugal and Coriolis terms and weight: N, N, N m.
    pub(super) bias: [f64; 3],
}

impl From<&DynamicsConfig> for Bodies {
    fn from(config: &DynamicsConfig) -> Self {
        let [xx, yy, zz, xy, xz, yz] = config.platform_inertia_kg_m2;
        Self {
            carriage_kg: config.carriage_mass_kg,
            cylinder: Link {
                mass_kg: config.cylinder_mass_kg,
                centre_m: config.cylinder_centre_m,
                inertia_kg_m2: config.cylinder_inertia_kg_m2,
            },
            rod: Link {
                mass_kg: config.rod_mass_kg,
                centre_m: config.rod_centre_m,
                inertia_kg_m2: config.rod_inertia_kg_m2,
            },
            platform: Platform {
                mass_kg: config.platform_mass_kg,
                centre_m: Vec3::from(config.platform_centre_m),
                inertia_kg_m2: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            },
            gravity_m_s2: config.gravity_m_s2,
        }
    }
}

impl Bodies {
    /// Mass that each axis d₁ d₂ d₃ l₁ l₂ l₃ moves in its own direction, kg, without the platform.
    pub fn axis_mass_kg(&self) -> Vector6<f64> {
        let (slide, leg) = (self.slide_kg(), self.rod.mass_kg);
        Vector6::new(slide, slide, slide, leg, leg, leg)
    }

    /// Carriage, cylinder and rod, kg.
    fn slide_kg(&self) -> f64 {
        self.carriage_kg + self.cylinder.mass_kg + self.rod.mass_kg
    }

    /// Distance of the rod's centre of mass from the hinge, w = l − b, m.
    pub(super) fn rod_from_hinge_m(&self, leg_m: f64) -> f64 {
        leg_m - self.rod.centre_m
    }

    /// First moment of cylinder and rod about the hinge, kg m.
    fn leg_moment_kg_m(&self, leg_m: f64) -> f64 {
        self.cylinder.mass_kg * self.cylinder.centre_m + self.rod.mass_kg * self.rod_from_hinge_m(leg_m)
    }

    /// Inertia of cylinder and rod about the hinge, kg m².
    fn leg_inertia_kg_m2(&self, leg_m: f64) -> f64 {
        let about_hinge = |link: &Link, arm_m: f64| link.inertia_kg_m2 + link.mass_kg * arm_m * arm_m;
        about_hinge(&self.cylinder, self.cylinder.centre_m)
            + about_hinge(&self.rod, self.rod_from_hinge_m(leg_m))
    }

    /// Q_d = (m_c + m_y + m_r) d̈, Q_l = m_r l̈ − m_r w θ̇² + m_r g sin θ,
    /// Q_θ = (I_y + m_y a² + I_r + m_r w²) θ̈ + 2 m_r w l̇ θ̇ + g (m_y a + m_r w) cos θ.
    pub(super) fn leg(&self, motion: &Motion, leg: usize) -> LegEquations {
        let leg_m = motion.legs.actuators.leg_m[leg];
        let (sin, cos) = motion.legs.sin_cos[leg];
        let (stretch_m_s, swing_rad_s) = (motion.rates_m_s[LEGS + leg], motion.swings_rad_s[leg]);
        let rod_kg_m = self.rod.mass_kg * self.rod_from_hinge_m(leg_m);
        LegEquations {
            masses: [self.slide_kg(), self.rod.mass_kg, self.leg_inertia_kg_m2(leg_m)],
            bias: [
                0.0,
                self.rod.mass_kg * self.gravity_m_s2 * sin - rod_kg_m * swing_rad_s * swing_rad_s,
                2.0 * rod_kg_m * stretch_m_s * swing_rad_s
                    + self.gravity_m_s2 * self.leg_moment_kg_m(leg_m) * cos,
            ],
        }
    }
}

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
#[derive(Debug, Clone, Copy, Default, PartialEq)]
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
        let bias = JointAccelerations::default();
        let mut motion = Self { pose: *pose, twist: *twist, legs, jacobian, rates_m_s, swings_rad_s, bias };
        motion.bias = motion.constant_twist_accelerations();
        Ok(motion)
    }

    /// Accelerations of the joints for a rate of change of the twist in m/s² and rad/s²: J V̇ + J̇V.
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

    /// Under a constant twist a corner has the acceleration ω×(ω×r) alone. Slide and leg get their component of this
    /// vector. The leg also gets the centrifugal lθ̇², the hinge the Coriolis −2l̇θ̇/l. The first three columns of a
    /// row of the Jacobian are the direction to project on.
    fn constant_twist_accelerations(&self) -> JointAccelerations {
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
