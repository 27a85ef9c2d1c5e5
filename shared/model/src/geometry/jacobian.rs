//! The Jacobian from the platform's twist to joint rates, its conditioning, and a bound for the poses around.

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
        let sin_cos = joints.theta_rad.map(f64::sin_cos);
        let arms_m = mechanism.platform_corners().map(|corner| pose.rotation * corner);
        Self::of_legs(mechanism, &Legs { actuators: joints.actuators, sin_cos, arms_m })
    }

    /// The Jacobian for known directions of the legs (of [`Mechanism::legs`]).
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
    fn scaled(&self) -> Matrix6<f64> {
        let mut scaled = self.actuators;
        scaled.fixed_columns_mut::<3>(3).scale_mut(1.0 / self.length_m);
        scaled
    }
}

/// The singular values of the actuators' rates at a pose. Angular velocities are scaled by the platform's side A₁A₂, so
/// that all columns are velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditioning {
    scaled: Matrix6<f64>,
    smallest: f64,
    largest: f64,
}

impl Conditioning {
    /// The conditioning of a pose. For a pose with a value that is no number, the smallest singular value is 0 and the
    /// largest infinite.
    pub fn new(jacobian: &Jacobian) -> Self {
        let scaled = jacobian.scaled();
        // The eigenvalue iteration terminates for finite numbers only.
        if !scaled.iter().all(|rate| rate.is_finite()) {
            return Self { scaled, smallest: 0.0, largest: f64::INFINITY };
        }
        // Eigenvalues of JᵀJ cost half as much as the singular values of J. They are as good far below a condition
        // number of 10⁷; no mechanism is of use beyond it.
        let squares = (scaled.transpose() * scaled).symmetric_eigenvalues();
        Self { scaled, smallest: squares.min().max(0.0).sqrt(), largest: squares.max().sqrt() }
    }

    /// Ratio of the largest to the smallest singular value; infinite when singular, or no number.
    pub fn number(&self) -> f64 {
        if self.smallest > 0.0 { self.largest / self.smallest } else { f64::INFINITY }
    }

    /// An upper bound for the condition number of another pose of the same mechanism, without that pose's singular
    /// values. Each singular value changes by at most the norm of the matrices' difference (Weyl's inequality).
    /// Infinite for a pose too far away.
    pub fn most(&self, other: &Jacobian) -> f64 {
        let change = (other.scaled() - self.scaled).norm();
        if self.smallest > change {
            (self.largest + change) / (self.smallest - change)
        } else {
            f64::INFINITY
        }
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

    fn jacobian(from_home_m: [f64; 3], turn_rad: [f64; 3]) -> Jacobian {
        let mechanism = Mechanism::new(&MechanismConfig::default()).unwrap();
        let place_m = Vec3::new(0.0, 0.0, 0.268) + Vec3::from(from_home_m);
        let turn = UnitQuaternion::from_scaled_axis(Vec3::from(turn_rad));
        let pose = Pose::from_parts(Translation3::from(place_m), turn);
        Jacobian::new(&mechanism, &pose, &mechanism.inverse(&pose).unwrap())
    }

    proptest! {
        #[test]
        fn no_pose_is_worse_than_its_bound_from_another(
            metres in [[-0.02..0.02f64, -0.02..0.02, -0.02..0.02], [-1e-3..1e-3f64, -1e-3..1e-3, -1e-3..1e-3]],
            radians in [[-0.4..0.4f64, -0.4..0.4, -0.4..0.4], [-0.02..0.02f64, -0.02..0.02, -0.02..0.02]],
        ) {
            let sum = |[at, change]: [[f64; 3]; 2]| std::array::from_fn(|i| at[i] + change[i]);
            let here = jacobian(metres[0], radians[0]);
            let other = jacobian(sum(metres), sum(radians));
            let conditioning = Conditioning::new(&here);
            prop_assert!(conditioning.most(&other) >= Conditioning::new(&other).number() * (1.0 - 1e-12));
            prop_assert!((conditioning.most(&here) - conditioning.number()).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_no_number_has_an_infinite_condition() {
        let [home, mut none] = [jacobian([0.0; 3], [0.0; 3]); 2];
        none.actuators[(2, 3)] = f64::NAN;
        assert!(Conditioning::new(&none).number().is_infinite());
        assert!(Conditioning::new(&home).most(&none).is_infinite());
        assert!(Conditioning::new(&none).most(&home).is_infinite());
    }

    #[test]
    fn the_papers_mechanism_is_mildly_conditioned_when_neutral() {
        let condition = Conditioning::new(&jacobian([0.0; 3], [0.0; 3])).number();
        assert!((1.0..5.0).contains(&condition), "{condition}");
    }

    #[test]
    fn a_mechanism_three_times_as_large_is_as_well_conditioned() {
        let condition_at_scale = |scale: f64| {
            let mut config = MechanismConfig::default();
            config.slides.iter_mut().for_each(|slide| slide.centre_m = slide.centre_m.map(|x| scale * x));
            config.platform_sides_m = config.platform_sides_m.map(|side_m| scale * side_m);
            let mechanism = Mechanism::new(&config).unwrap();
            let pose = Pose::translation(0.0, 0.005 * scale, 0.268 * scale);
            Conditioning::new(&Jacobian::new(&mechanism, &pose, &mechanism.inverse(&pose).unwrap())).number()
        };
        assert!((condition_at_scale(3.0) - condition_at_scale(1.0)).abs() < 1e-9);
    }
}
