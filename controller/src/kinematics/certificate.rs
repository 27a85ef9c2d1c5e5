//! Proof that a solution exists near computed leg angles, and that no other is close.
//!
//! The theorem of Newton and Kantorovich, in its form with an approximate inverse Y of the Jacobian.
//! Hypotheses:
//! - ‖Y g(θ)‖ ≤ y;
//! - ‖1 − Y g′(θ)‖ ≤ z < 1;
//! - ‖Y (g′(α) − g′(β))‖ ≤ K ‖α − β‖ for all α and β;
//! - (1 − z)² > 2 K y.
//!
//! Result: exactly one zero lies within R of θ, and it lies within r:
//!
//! r = 2y / (1 − z + √((1 − z)² − 2Ky)), R = (1 − z + √((1 − z)² − 2Ky)) / K.
//!
//! The norm is the largest of the three legs. K holds on the whole torus:
//! - Let κ = ω cos θᵢ cos θⱼ + sin θᵢ sin θⱼ and κ′ = ω sin θᵢ sin θⱼ + cos θᵢ cos θⱼ.
//! - The second derivatives of gₖ are κ − p cos θᵢ, κ − q cos θⱼ and twice −κ′.
//! - |κ| + |κ′| ≤ 1 + |ω|, because κ ± κ′ are (ω ± 1) times a cosine.
//! - So row k of the Jacobian changes by at most |p| + |q| + 2(1 + |ω|) times the change of the angles.
//!
//! Explicit margins cover rounding:
//! - y contains the bound ρₖ of each residual's rounding.
//! - r is rounded outward, and R inward.
//! - ρₖ also bounds the rounding of each derivative, of which a row has two. Y's own rounding counts no
//!   more than these two again. Hence z ≤ 4 max Σ|Yᵢₖ| ρₖ ≤ 4y.
//!
//! The proof holds for the input as an exact set of numbers, not for the errors of the encoders. The proof does not
//! identify the solution.

use masseter_model::geometry::LEGS;

use super::legs::each;
use super::loop_equations::{LoopEquations, PlatformSide, Residuals};

/// z per unit of y.
const INVERSE_ROUNDINGS: f64 = 4.0;
/// Margin of r, R and K for the roundings of their own formulas.
const OUTWARD: f64 = 1.0 + 64.0 * f64::EPSILON;

/// The proven distances of a solution. A distance is the largest difference of any leg's angle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Certificate {
    /// r: an exact solution lies at most this far from the computed angles, radians.
    pub exists_within_rad: f64,
    /// R: no other solution is closer to the computed angles, radians.
    pub unique_within_rad: f64,
    /// Within this distance the Jacobian is not singular, radians.
    pub regular_within_rad: f64,
}

impl Certificate {
    /// The proof at evaluated leg angles. None if the inequality does not hold or a value is no number, as at a
    /// singularity.
    #[inline]
    pub(super) fn new(loops: &LoopEquations<'_>, at: &Residuals) -> Option<Self> {
        let inverse = at.inverse();
        let most = |bounds: [f64; LEGS]| {
            largest(each(|row| {
                let [a, b, c] = inverse[row];
                a.abs() * bounds[0] + b.abs() * bounds[1] + c.abs() * bounds[2]
            }))
        };
        let offset_rad = most(each(|side| at.value[side].abs() + loops.sides[side].rounding))?;
        let curvature = most(each(|side| curvature_bound(&loops.sides[side])))?;
        Self::from_bounds(offset_rad * OUTWARD, curvature * OUTWARD)
    }

    #[inline]
    fn from_bounds(offset_rad: f64, curvature: f64) -> Option<Self> {
        let margin = 1.0 - INVERSE_ROUNDINGS * offset_rad;
        let discriminant = margin * margin - 2.0 * curvature * offset_rad;
        if margin <= 0.0 || discriminant <= 0.0 {
            return None;
        }
        let reach = margin + discriminant.sqrt();
        Some(Self {
            exists_within_rad: 2.0 * offset_rad / reach * OUTWARD,
            // Beyond half a turn the ball overlaps itself on the torus.
            unique_within_rad: (reach / curvature / OUTWARD).min(std::f64::consts::PI),
            regular_within_rad: margin / curvature / OUTWARD,
        })
    }
}

/// The largest of three; none if one is not finite.
#[inline]
fn largest([a, b, c]: [f64; LEGS]) -> Option<f64> {
    (a + b + c).is_finite().then(|| a.max(b).max(c))
}

/// Largest total change of row k of the Jacobian per radian of the largest change of an angle.
#[inline]
fn curvature_bound(side: &PlatformSide) -> f64 {
    side.near_cos.abs() + side.far_cos.abs() + 2.0 * (1.0 + side.cos_cos.abs()) + side.rounding
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Actuators;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::legs::LegAngle;
    use crate::kinematics::tests::{mechanisms, poses, published_mechanism};

    fn certify(loops: &LoopEquations<'_>, theta_rad: [f64; LEGS]) -> Option<Certificate> {
        Certificate::new(loops, &loops.evaluate(&theta_rad.map(LegAngle::from_rad)))
    }

    #[test]
    fn the_neutral_pose_is_certain_within_degrees() {
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let mechanism = published_mechanism();
        let loops = LoopEquations::new(&mechanism, &neutral);
        let start = [83.862_391_93_f64.to_radians(); LEGS].map(LegAngle::from_rad);
        let closed = loops.close(&start, 4).unwrap();
        let certificate = Certificate::new(&loops, &closed.residuals).unwrap();
        assert!(certificate.exists_within_rad < 1e-12);
        assert!(certificate.unique_within_rad.to_degrees() > 2.0, "{certificate:?}");
        // The next solution, with the platform turned over, is 12.57° away.
        assert!(certificate.unique_within_rad.to_degrees() < 12.57);
    }

    #[test]
    fn what_is_no_solution_and_what_is_no_number_is_not_certified() {
        let neutral = Actuators { slide_m: [0.0; LEGS], leg_m: [0.27; LEGS] };
        let mechanism = published_mechanism();
        let loops = LoopEquations::new(&mechanism, &neutral);
        assert_eq!(certify(&loops, [1.2, 1.5, 1.3]), None);
        assert_eq!(certify(&loops, [f64::NAN; LEGS]), None);
        // All legs level: no side changes at first order, the Jacobian vanishes.
        assert_eq!(certify(&loops, [0.0; LEGS]), None);
    }

    proptest! {
        /// Close to a solution the certificate holds, and both radii bracket the true distance.
        #[test]
        fn the_solution_lies_within_the_radius_of_existence(
            mechanism in mechanisms(), pose in poses(20.0),
            off in [-1e-3..1e-3f64, -1e-3..1e-3f64, -1e-3..1e-3f64],
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let loops = LoopEquations::new(&mechanism, &joints.actuators);
            let theta_rad = std::array::from_fn(|leg| joints.theta_rad[leg] + off[leg]);
            if let Some(certificate) = certify(&loops, theta_rad) {
                let distance = off.iter().fold(0.0, |worst: f64, off| worst.max(off.abs()));
                prop_assert!(distance <= certificate.exists_within_rad + 1e-13);
                prop_assert!(certificate.exists_within_rad < certificate.unique_within_rad);
            }
        }

        /// The bound on the Jacobian's change, against its change.
        #[test]
        fn the_jacobian_changes_no_faster_than_bounded(
            mechanism in mechanisms(), pose in poses(25.0),
            a in prop::array::uniform3(-3.1..3.1f64), b in prop::array::uniform3(-3.1..3.1f64),
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let loops = LoopEquations::new(&mechanism, &joints.actuators);
            let at = |theta_rad: [f64; LEGS]| loops.evaluate(&theta_rad.map(LegAngle::from_rad));
            let (here, there) = (at(a), at(b));
            let distance = (0..LEGS).map(|leg| (a[leg] - b[leg]).abs()).fold(0.0, f64::max);
            for side in 0..LEGS {
                let change = (here.near[side] - there.near[side]).abs() + (here.far[side] - there.far[side]).abs();
                prop_assert!(change <= curvature_bound(&loops.sides[side]) * distance + 1e-12);
            }
        }
    }
}
