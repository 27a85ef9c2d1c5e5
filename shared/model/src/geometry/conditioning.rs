//! How well conditioned a pose is, and a bound for the poses around it.

use nalgebra::Matrix6;

use super::Jacobian;

/// The singular values of a pose's actuators' rates, with angular velocities scaled by the platform's side A₁A₂ so that all
/// columns are velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditioning {
    scaled: Matrix6<f64>,
    smallest: f64,
    largest: f64,
}

impl Conditioning {
    /// The conditioning of a pose. The smallest singular value is 0 and the largest infinite where the pose is no number.
    pub fn new(jacobian: &Jacobian) -> Self {
        let scaled = jacobian.scaled();
        // The eigenvalue iteration terminates for finite numbers only.
        if !scaled.iter().all(|rate| rate.is_finite()) {
            return Self { scaled, smallest: 0.0, largest: f64::INFINITY };
        }
        // Eigenvalues of JᵀJ cost half as much as the singular values of J. They are as good far below a condition number
        // of 10⁷, and no mechanism is of use beyond.
        let squares = (scaled.transpose() * scaled).symmetric_eigenvalues();
        Self { scaled, smallest: squares.min().max(0.0).sqrt(), largest: squares.max().sqrt() }
    }

    /// Ratio of the largest to the smallest singular value; infinite when singular, or no number.
    pub fn number(&self) -> f64 {
        if self.smallest > 0.0 { self.largest / self.smallest } else { f64::INFINITY }
    }

    /// A condition number that another pose of the same mechanism does not exceed, without singular values of its own:
    /// each of them differs from the one here by at most the norm of the matrices' difference (Weyl's inequality).
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
    use crate::geometry::{Mechanism, MechanismConfig, Pose, Vec3};

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
