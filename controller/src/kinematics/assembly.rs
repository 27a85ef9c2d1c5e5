//! Which solution of the equations is the mechanism as it was assembled.
//!
//! The paper selects the true solution by two conditions: every Bᵢ below the plane of A₁A₂A₃, and A₂
//! beyond A₃ along slide 1. Read without a sign for the plane they leave several candidates, so the
//! plane is oriented here by (A₂−A₁)×(A₃−A₁), the legs must stand above the base, and the Jacobian's
//! determinant must be positive. These together do *not* always leave one solution: near the
//! edge of the strokes about one standing input in 23,000 has two (see
//! [`uniqueness`](super::uniqueness)), and nothing here relies on there being one.

use masseter_model::geometry::{Actuators, LEGS, Legs, Mechanism, Pose, Vec3};
use nalgebra::Vector3;

use super::Equations;
use super::equations::directions;
use super::legs::each;

/// What must hold for a true solution, in the order in which it is checked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum Condition {
    /// Corner Aᵢ lies above the base.
    #[error("leg {} does not stand above the base", leg + 1)]
    LegAboveBase {
        /// Index of the leg, from 0.
        leg: usize,
    },
    /// The paper, condition 1: hinge Bᵢ lies on the negative side of the platform's plane.
    #[error("hinge B{} is not below the plane of the platform (condition 1)", leg + 1)]
    HingeBelowPlatform {
        /// Index of the leg, from 0.
        leg: usize,
    },
    /// The paper, condition 2: A₂ lies beyond A₃ in the direction of slide 1.
    #[error("A2 is not beyond A3 along slide 1 (condition 2)")]
    CornersInOrder,
    /// The determinant of the Jacobian is positive, as at the neutral pose.
    #[error("the determinant of the Jacobian is not positive")]
    PositiveDeterminant,
}

/// Which conditions hold at a set of leg angles; NaN fulfils none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Assembly {
    /// [`Condition::LegAboveBase`] of each leg.
    pub legs_above_base: [bool; LEGS],
    /// [`Condition::HingeBelowPlatform`] of each leg.
    pub hinges_below_platform: [bool; LEGS],
    /// [`Condition::CornersInOrder`].
    pub corners_in_order: bool,
    /// [`Condition::PositiveDeterminant`].
    pub positive_determinant: bool,
}

impl Assembly {
    /// Judges leg angles in radians.
    pub fn new(mechanism: &Mechanism, actuators: &Actuators, theta_rad: &[f64; LEGS]) -> Self {
        let equations = Equations::new(mechanism, actuators);
        let at = equations.evaluate(Vector3::from(*theta_rad));
        let hinges = std::array::from_fn(|leg| mechanism.hinge(leg, actuators.slide_m[leg]));
        Self::from_corners(mechanism, &hinges, &at.corners, equations.determinant(&at))
    }

    /// Judges a pose and its legs (of [`Mechanism::legs`]).
    pub fn at_pose(mechanism: &Mechanism, pose: &Pose, legs: &Legs) -> Self {
        let corners = legs.arms_m.map(|arm| arm + pose.translation.vector);
        let hinges = std::array::from_fn(|leg| mechanism.hinge(leg, legs.actuators.slide_m[leg]));
        let determinant = directions(mechanism, &corners, &legs.sin_cos).determinant();
        Self::from_corners(mechanism, &hinges, &corners, determinant)
    }

    #[inline]
    pub(super) fn from_corners(
        mechanism: &Mechanism,
        hinges: &[Vec3; LEGS],
        corners: &[Vec3; LEGS],
        determinant: f64,
    ) -> Self {
        let [a1, a2, a3] = *corners;
        let normal = (a2 - a1).cross(&(a3 - a1));
        Self {
            legs_above_base: each(|leg| corners[leg].z > 0.0),
            hinges_below_platform: each(|leg| (hinges[leg] - a1).dot(&normal) < 0.0),
            corners_in_order: (a2 - a3).dot(&mechanism.slide_direction(0)) > 0.0,
            positive_determinant: determinant > 0.0,
        }
    }

    /// The first condition that does not hold.
    #[inline]
    pub fn violated(&self) -> Option<Condition> {
        let fails = |holds: &[bool; LEGS]| holds.iter().position(|holds| !holds);
        if let Some(leg) = fails(&self.legs_above_base) {
            return Some(Condition::LegAboveBase { leg });
        }
        if let Some(leg) = fails(&self.hinges_below_platform) {
            return Some(Condition::HingeBelowPlatform { leg });
        }
        if !self.corners_in_order {
            return Some(Condition::CornersInOrder);
        }
        (!self.positive_determinant).then_some(Condition::PositiveDeterminant)
    }

    /// Whether all conditions hold.
    #[inline]
    pub fn is_true(&self) -> bool {
        self.violated().is_none()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::tests::published_mechanism;

    /// The eight solutions above the base at the neutral input, by their angles in degrees.
    #[test]
    fn only_the_upright_solution_of_the_neutral_input_is_true() {
        let mechanism = published_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let judge = |deg: [f64; LEGS]| Assembly::new(&mechanism, &neutral, &deg.map(f64::to_radians));
        assert!(judge([83.8624; LEGS]).is_true());
        assert!(!judge([71.29; LEGS]).is_true());
        for leg in 0..LEGS {
            let with = |one: f64, others: f64| std::array::from_fn(|i| if i == leg { one } else { others });
            assert!(!judge(with(66.04, 83.86)).is_true());
            assert!(!judge(with(89.49, 71.29)).is_true());
        }
    }

    #[test]
    fn the_violated_condition_is_named() {
        let mechanism = published_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let mirrored = Assembly::new(&mechanism, &neutral, &[-83.8624_f64.to_radians(); LEGS]);
        assert_eq!(mirrored.violated(), Some(Condition::LegAboveBase { leg: 0 }));
        let inverted = Assembly::new(&mechanism, &neutral, &[71.29_f64.to_radians(); LEGS]);
        assert!(inverted.violated().unwrap().to_string().contains("condition"));
    }

    #[test]
    fn no_number_fulfils_no_condition() {
        let mechanism = published_mechanism();
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        assert!(!Assembly::new(&mechanism, &neutral, &[f64::NAN; LEGS]).is_true());
    }

    #[test]
    fn a_pose_is_judged_as_its_leg_angles_are() {
        let mechanism = published_mechanism();
        let judged = (-12..=12).map(|step| {
            let pose = Pose::new(Vec3::new(0.0, 0.0, 0.268), Vec3::new(0.25, 0.1, 0.05) * f64::from(step));
            let joints = mechanism.inverse(&pose).unwrap();
            let assembly = Assembly::at_pose(&mechanism, &pose, &mechanism.legs(&pose).unwrap());
            assert_eq!(assembly, Assembly::new(&mechanism, &joints.actuators, &joints.theta_rad), "{pose}");
            assembly.is_true()
        });
        let true_ones = judged.filter(|is_true| *is_true).count();
        assert!((1..25).contains(&true_ones), "{true_ones} of 25 are true");
    }
}
