//! The result of a solver: leg angles that close the platform's triangle, or the reason for their absence.
//!
//! The paper selects the true solution by two conditions: every Bᵢ below the plane of A₁A₂A₃, and A₂ beyond A₃ along
//! slide 1. Without a sign for the plane these leave several candidates. So this module adds three conditions:
//! (A₂−A₁)×(A₃−A₁) orients the plane, the legs stand above the base, and the Jacobian's determinant is positive.
//!
//! All five together do *not* always leave one solution. Near the edge of the strokes about one standing input in
//! 23,000 has two solutions (`docs/uniqueness.md`). This module does not rely on a single solution.

use masseter_model::geometry::{AXIS_NAMES, Actuators, LEGS, Legs, Mechanism, Pose, Vec3, frame_of_corners};

use super::certificate::Certificate;
use super::equations::{Equations, directions};
use super::legs::{LegAngle, each};
use super::loop_equations::{LoopEquations, LoopSolution};

/// Conditions of a true solution, in the order of the checks.
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
        let at = equations.evaluate(nalgebra::Vector3::from(*theta_rad));
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

/// Leg angles that close the platform's triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// θ₁ θ₂ θ₃ in (−π, π], radians.
    pub theta_rad: [f64; LEGS],
    /// The platform in the base frame, metres.
    pub pose: Pose,
    /// Iterations from the start of this solution.
    pub iterations: u32,
    /// The largest |fₖ|, metres.
    pub residual_m: f64,
    /// Determinant of the Jacobian with every leg's length taken as 1; 0 where solutions meet.
    pub determinant: f64,
    /// Which conditions of the true solution hold.
    pub assembly: Assembly,
    /// The proof; none too close to a singularity, or after a premature end of the iteration.
    pub certificate: Option<Certificate>,
    pub(super) leg_angles: [LegAngle; LEGS],
}

impl Solution {
    pub(super) fn new(loops: &LoopEquations<'_>, closed: &LoopSolution) -> Self {
        Self::with_angles(loops, closed, closed.leg_angles.map(LegAngle::to_rad))
    }

    /// The same solution with these angles, radians.
    #[inline]
    pub(super) fn with_angles(
        loops: &LoopEquations<'_>,
        closed: &LoopSolution,
        theta_rad: [f64; LEGS],
    ) -> Self {
        let corners = loops.corners(&closed.leg_angles);
        let determinant = loops.determinant(&closed.residuals);
        Self {
            theta_rad,
            pose: frame_of_corners(&corners),
            iterations: closed.iterations,
            residual_m: loops.residual_m(&closed.residuals),
            determinant,
            assembly: Assembly::from_corners(loops.mechanism, &loops.hinges, &corners, determinant),
            certificate: Certificate::new(loops, &closed.residuals),
            leg_angles: closed.leg_angles,
        }
    }
}

/// An input without a true solution, by the result of the solver.
#[doc(alias = "direct kinematics")]
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ForwardError {
    /// An actuator or the guess is no finite number.
    #[error("an actuator coordinate or the guess is not a finite number; check the input")]
    NotFinite,
    /// The iteration reached its bound.
    #[error(
        "no convergence: after {iterations} iterations a side of the platform is still off by \
         {residual_m:e} m; start closer to the solution, or check that the mechanism can be assembled"
    )]
    NoConvergence {
        /// The largest |fₖ| at the end, metres.
        residual_m: f64,
        /// Iterations made.
        iterations: u32,
    },
    /// No halving of the increment decreases the error: a local minimum.
    #[error(
        "stalled in a local minimum after {iterations} iterations: a side of the platform is off by \
         {residual_m:e} m; start closer to the solution, or check that the mechanism can be assembled"
    )]
    Stalled {
        /// The largest |fₖ| at the minimum, metres.
        residual_m: f64,
        /// Iterations made.
        iterations: u32,
    },
    /// The Jacobian has no inverse at the iteration's end, or rounding does not separate two solutions.
    #[error(
        "singular: the Jacobian's determinant is {determinant:e} with a side of the platform off by \
         {residual_m:e} m; start elsewhere or keep away from this input"
    )]
    Singular {
        /// Determinant with every leg's length taken as 1.
        determinant: f64,
        /// The largest |fₖ| there, metres.
        residual_m: f64,
    },
    /// A solution of the equations in which the mechanism cannot stand.
    #[error(
        "solved, but not as the mechanism is assembled: {violated}; check the six inputs and the scenario's [mechanism]"
    )]
    WrongAssembly {
        /// The first condition that does not hold.
        violated: Condition,
    },
    /// A leg's length is zero or negative.
    #[error("leg {} is {leg_m:e} m long, so its angle is undefined; check the input {}", leg + 1, AXIS_NAMES[3 + leg])]
    NoLength {
        /// Index of the leg, from 0.
        leg: usize,
        /// Its length.
        leg_m: f64,
    },
    /// No leg angles close the platform's triangle: there are no real solutions.
    #[error("the mechanism cannot be assembled, whatever the leg angles; check the six inputs")]
    Unassemblable,
    /// More than one solution fulfils every condition of the true one.
    #[error(
        "ambiguous: {count} solutions stand as the mechanism is assembled, {separation_rad} rad apart; \
         approach this input from a known pose"
    )]
    Ambiguous {
        /// How many.
        count: usize,
        /// The distance of the nearest two, the largest difference of any leg, radians.
        separation_rad: f64,
    },
    /// More solutions than the equations have: they form a continuum but for rounding.
    #[error("undecided: the solutions cannot be separated, only {solutions} were; keep away from this input")]
    Undecided {
        /// Solutions that were separated.
        solutions: usize,
    },
}

impl ForwardError {
    /// One word for a status column.
    pub fn reason(&self) -> &'static str {
        match self {
            Self::NotFinite => "not_finite",
            Self::NoConvergence { .. } => "no_convergence",
            Self::Stalled { .. } => "stalled",
            Self::Singular { .. } => "singular",
            Self::WrongAssembly { .. } => "wrong_assembly",
            Self::NoLength { .. } => "no_length",
            Self::Unassemblable => "unassemblable",
            Self::Ambiguous { .. } => "ambiguous",
            Self::Undecided { .. } => "undecided",
        }
    }

    /// Error of a side of the platform at the iteration's end, metres; none without an iteration that ends short of a
    /// solution.
    pub fn residual_m(&self) -> Option<f64> {
        match *self {
            Self::NoConvergence { residual_m, .. }
            | Self::Stalled { residual_m, .. }
            | Self::Singular { residual_m, .. } => Some(residual_m),
            _ => None,
        }
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
