//! The three loop equations with the sides squared. In this form they are bilinear in the leg angles' cosines and
//! sines: elimination, fast iteration and certificate use it.
//!
//! Side k joins leg i = k to leg j = k + 1. With c = Bᵢ − Bⱼ and v̂ the inward directions,
//!
//! gₖ = (|AᵢAⱼ|² − Lₖ²) / 2lᵢlⱼ = κ + p cos θᵢ + q cos θⱼ − ω cos θᵢ cos θⱼ − sin θᵢ sin θⱼ,
//!
//! κ = (|c|² + lᵢ² + lⱼ² − Lₖ²) / 2lᵢlⱼ, p = v̂ᵢ·c / lⱼ, q = −v̂ⱼ·c / lᵢ, ω = v̂ᵢ·v̂ⱼ.
//!
//! gₖ = 0 exactly where the paper's fₖ = 0 (eq. 1). The module does not choose a
//! solution. The paper's own form of the equations is [`Equations`](super::Equations).

use masseter_model::geometry::{Actuators, LEGS, Mechanism, Vec3};

use super::legs::{LegAngle, each, next};

/// Bound of the error of gₖ and its derivatives, in units of the machine epsilon times the `scale` of
/// [`PlatformSide::new`].
///
/// At most 33 roundings of half an epsilon each add up:
/// - 20 from the hinges to κ,
/// - 6 in the sum,
/// - 3 in a product,
/// - 4 for leg angles that are 2 roundings off the circle.
const ROUNDINGS: f64 = 20.0;
/// No Newton step is longer; a longer one only shows that the Jacobian is nearly singular.
const LONGEST_STEP_RAD: f64 = 1.0;

/// The coefficients of one gₖ; unitless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlatformSide {
    pub constant: f64,
    pub near_cos: f64,
    pub far_cos: f64,
    pub cos_cos: f64,
    /// 2lᵢlⱼ, m²: the factor from gₖ to a difference of squares.
    pub unit_m2: f64,
    pub length_m: f64,
    /// Largest rounding error of the computed gₖ.
    pub rounding: f64,
}

/// The equations for one input.
#[derive(Debug, Clone, Copy)]
#[doc(alias("loop-closure equations", "constraint equations"))]
pub(super) struct LoopEquations<'a> {
    pub(super) mechanism: &'a Mechanism,
    pub(super) actuators: Actuators,
    /// Bᵢ, metres.
    pub(super) hinges: [Vec3; LEGS],
    pub(super) sides: [PlatformSide; LEGS],
}

/// Values and derivatives of the three gₖ at one set of leg angles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Residuals {
    pub value: [f64; LEGS],
    /// ∂gₖ/∂θₖ.
    pub near: [f64; LEGS],
    /// ∂gₖ/∂θₖ₊₁.
    pub far: [f64; LEGS],
}

/// The end of an iteration: every gₖ is zero, except for rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LoopSolution {
    pub leg_angles: [LegAngle; LEGS],
    pub residuals: Residuals,
    pub iterations: u32,
}

/// One leg's end of its two sides.
#[derive(Debug, Clone, Copy)]
struct End {
    hinge: Vec3,
    inward: Vec3,
    leg_m: f64,
    /// 1/lᵢ.
    per_leg_m: f64,
    /// Bound of the hinge's coordinates and of their terms, metres.
    extent_m: f64,
}

impl End {
    #[inline]
    fn new(mechanism: &Mechanism, actuators: &Actuators, leg: usize) -> Self {
        let (slide_m, leg_m) = (actuators.slide_m[leg], actuators.leg_m[leg]);
        let hinge = mechanism.hinge(leg, slide_m);
        Self {
            hinge,
            inward: mechanism.inward_direction(leg),
            leg_m,
            per_leg_m: 1.0 / leg_m,
            extent_m: hinge.x.abs() + hinge.y.abs() + 2.0 * slide_m.abs(),
        }
    }
}

impl PlatformSide {
    #[inline]
    fn new(near: &End, far: &End, length_m: f64) -> Self {
        let hinges = near.hinge - far.hinge;
        let (unit_m2, per_unit) = (2.0 * near.leg_m * far.leg_m, 0.5 * near.per_leg_m * far.per_leg_m);
        let legs_m2 = near.leg_m * near.leg_m + far.leg_m * far.leg_m;
        let length_m2 = length_m * length_m;
        // Upper bound of every term of gₖ, of its derivatives, and of their parts.
        let extent_m = near.extent_m + far.extent_m;
        let scale = (extent_m * extent_m + legs_m2 + length_m2) * per_unit
            + extent_m * (near.per_leg_m + far.per_leg_m)
            + 2.0;
        Self {
            constant: (hinges.norm_squared() + legs_m2 - length_m2) * per_unit,
            near_cos: near.inward.dot(&hinges) * far.per_leg_m,
            far_cos: -far.inward.dot(&hinges) * near.per_leg_m,
            cos_cos: near.inward.dot(&far.inward),
            unit_m2,
            length_m,
            rounding: ROUNDINGS * f64::EPSILON * scale,
        }
    }

    /// gₖ.
    #[inline]
    pub(super) fn value(&self, near: LegAngle, far: LegAngle) -> f64 {
        let far_slope = self.far_cos - self.cos_cos * near.cos;
        self.constant + self.near_cos * near.cos + far_slope * far.cos - near.sin * far.sin
    }

    #[inline]
    fn near_derivative(&self, near: LegAngle, far: LegAngle) -> f64 {
        near.sin * (self.cos_cos * far.cos - self.near_cos) - near.cos * far.sin
    }

    #[inline]
    fn far_derivative(&self, near: LegAngle, far: LegAngle) -> f64 {
        far.sin * (self.cos_cos * near.cos - self.far_cos) - far.cos * near.sin
    }

    /// fₖ = |AᵢAⱼ| − Lₖ for a value of gₖ, metres.
    #[inline]
    fn excess_m(&self, value: f64) -> f64 {
        let difference_m2 = value * self.unit_m2;
        difference_m2 / ((self.length_m * self.length_m + difference_m2).max(0.0).sqrt() + self.length_m)
    }
}

impl<'a> LoopEquations<'a> {
    /// The equations for an input in metres. No leg may have length zero.
    #[inline]
    pub(super) fn new(mechanism: &'a Mechanism, actuators: &Actuators) -> Self {
        let ends = each(|leg| End::new(mechanism, actuators, leg));
        let lengths_m = mechanism.platform_sides_m();
        Self {
            mechanism,
            actuators: *actuators,
            hinges: each(|leg| ends[leg].hinge),
            sides: each(|side| PlatformSide::new(&ends[side], &ends[next(side)], lengths_m[side])),
        }
    }

    #[inline]
    pub(super) fn evaluate(&self, leg_angles: &[LegAngle; LEGS]) -> Residuals {
        let at = |formula: fn(&PlatformSide, LegAngle, LegAngle) -> f64| {
            each(|side| formula(&self.sides[side], leg_angles[side], leg_angles[next(side)]))
        };
        Residuals {
            value: at(PlatformSide::value),
            near: at(PlatformSide::near_derivative),
            far: at(PlatformSide::far_derivative),
        }
    }

    /// The platform's corners Aᵢ in the base frame, metres.
    #[inline]
    pub(super) fn corners(&self, leg_angles: &[LegAngle; LEGS]) -> [Vec3; LEGS] {
        each(|leg| {
            let (LegAngle { cos, sin }, leg_m) = (leg_angles[leg], self.actuators.leg_m[leg]);
            let mut corner = self.hinges[leg] + self.mechanism.inward_direction(leg) * (cos * leg_m);
            corner.z += sin * leg_m;
            corner
        })
    }

    /// Newton's iteration from these leg angles; none when `max_iterations` do not close the platform.
    #[inline]
    pub(super) fn close(&self, start: &[LegAngle; LEGS], max_iterations: u32) -> Option<LoopSolution> {
        let mut leg_angles = *start;
        for iterations in 0..=max_iterations {
            let residuals = self.evaluate(&leg_angles);
            if self.is_closed(&residuals) {
                return Some(LoopSolution { leg_angles, residuals, iterations });
            }
            let step_rad = residuals.newton_step_rad();
            leg_angles = each(|leg| leg_angles[leg].stepped(step_rad[leg]));
        }
        None
    }

    #[inline]
    fn is_closed(&self, residuals: &Residuals) -> bool {
        each(|side| residuals.value[side].abs() <= self.sides[side].rounding) == [true; LEGS]
    }

    /// The largest |fₖ|, metres.
    pub(super) fn residual_m(&self, residuals: &Residuals) -> f64 {
        let [f1, f2, f3] = each(|side| self.sides[side].excess_m(residuals.value[side]).abs());
        f1.max(f2).max(f3)
    }

    /// [`Equations::determinant`](super::Equations::determinant) where the platform is closed.
    pub(super) fn determinant(&self, residuals: &Residuals) -> f64 {
        let product = |[a, b, c]: [f64; LEGS]| a * b * c;
        let sides_m = each(|side| self.sides[side].length_m);
        residuals.determinant() * product(self.actuators.leg_m) / product(sides_m)
    }
}

impl Residuals {
    /// Determinant of ∂g/∂θ.
    #[inline]
    pub(super) fn determinant(&self) -> f64 {
        let ([a, b, c], [d, e, f]) = (self.near, self.far);
        a * b * c + d * e * f
    }

    /// At the mirrored leg angles, −θ: gₖ is even.
    pub(super) fn mirrored(&self) -> Self {
        Self { value: self.value, near: self.near.map(|slope| -slope), far: self.far.map(|slope| -slope) }
    }

    /// Inverse of ∂g/∂θ: row for the leg, column for the side. Every cofactor is a single product. So each entry is
    /// right to two roundings, except for the common rounding of the determinant.
    #[inline]
    pub(super) fn inverse(&self) -> [[f64; LEGS]; LEGS] {
        let ([a, b, c], [d, e, f]) = (self.near, self.far);
        let scale = 1.0 / self.determinant();
        let cofactors = [[b * c, -c * d, d * e], [e * f, a * c, -a * e], [-b * f, d * f, a * b]];
        each(|row| each(|column| cofactors[row][column] * scale))
    }

    /// The null direction of a nearly singular Jacobian: its adjugate's longest column. Along it the equations nearly
    /// hold to first order. The largest component has magnitude 1; all are zero for a rank of 1 or less.
    pub(super) fn null_direction(&self) -> [f64; LEGS] {
        let ([a, b, c], [d, e, f]) = (self.near, self.far);
        let columns = [[b * c, e * f, -b * f], [-c * d, a * c, d * f], [d * e, -a * e, a * b]];
        let length = |column: &[f64; LEGS]| column.iter().fold(0.0, |most: f64, entry| most.max(entry.abs()));
        let longest = columns.into_iter().max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or_default();
        longest.map(|entry| entry / length(&longest).max(f64::MIN_POSITIVE))
    }

    /// −(∂g/∂θ)⁻¹ g, bounded; zero for a Jacobian without an inverse.
    #[inline]
    fn newton_step_rad(&self) -> [f64; LEGS] {
        let inverse = self.inverse();
        each(|leg| {
            let [a, b, c] = inverse[leg];
            let step = -(a * self.value[0] + b * self.value[1] + c * self.value[2]);
            if step.is_nan() { 0.0 } else { step.clamp(-LONGEST_STEP_RAD, LONGEST_STEP_RAD) }
        })
    }
}

impl LoopSolution {
    /// The same platform below the base.
    pub(super) fn mirrored(&self) -> Self {
        let leg_angles = self.leg_angles.map(LegAngle::mirrored);
        Self { leg_angles, residuals: self.residuals.mirrored(), iterations: self.iterations }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::Equations;
    use crate::kinematics::tests::{mechanisms, poses};

    proptest! {
        #[test]
        fn it_agrees_with_the_papers_form_of_the_equations(
            mechanism in mechanisms(), pose in poses(25.0), off in -0.5..0.5f64,
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let loops = LoopEquations::new(&mechanism, &joints.actuators);
            let equations = Equations::new(&mechanism, &joints.actuators);
            let solved = loops.evaluate(&joints.theta_rad.map(LegAngle::from_rad));
            prop_assert!(loops.is_closed(&solved));
            let determinant = equations.determinant(&equations.evaluate(joints.theta_rad.into()));
            prop_assert!((loops.determinant(&solved) - determinant).abs() < 1e-12);
            let theta_rad = [joints.theta_rad[0] + off, joints.theta_rad[1], joints.theta_rad[2] - off];
            let away = loops.evaluate(&theta_rad.map(LegAngle::from_rad));
            let expected = equations.evaluate(theta_rad.into());
            prop_assert!((loops.residual_m(&away) - expected.residual_norm_m()).abs() < 1e-14);
        }

        #[test]
        fn the_inverse_inverts_the_derivatives(
            mechanism in mechanisms(), pose in poses(25.0),
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let loops = LoopEquations::new(&mechanism, &joints.actuators);
            let at = |theta_rad: [f64; LEGS]| loops.evaluate(&theta_rad.map(LegAngle::from_rad));
            let here = at(joints.theta_rad);
            prop_assume!(loops.determinant(&here).abs() > 1e-3);
            let h = 1e-6;
            for leg in 0..LEGS {
                let mut ahead = joints.theta_rad;
                ahead[leg] += h;
                let change = at(ahead).value;
                for (row, inverse) in here.inverse().iter().enumerate() {
                    let unit: f64 = (0..LEGS).map(|side| inverse[side] * change[side] / h).sum();
                    prop_assert!((unit - f64::from(u8::from(row == leg))).abs() < 1e-2);
                }
            }
        }

        #[test]
        fn newton_closes_the_platform_from_nearby(
            mechanism in mechanisms(), pose in poses(20.0), off in [-0.01..0.01f64, -0.01..0.01f64, -0.01..0.01f64],
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let loops = LoopEquations::new(&mechanism, &joints.actuators);
            let at = loops.evaluate(&joints.theta_rad.map(LegAngle::from_rad));
            prop_assume!(loops.determinant(&at).abs() > 0.3);
            let start = std::array::from_fn(|leg| LegAngle::from_rad(joints.theta_rad[leg] + off[leg]));
            let closed = loops.close(&start, 5).unwrap();
            prop_assert!(closed.iterations <= 5 && loops.residual_m(&closed.residuals) < 1e-13);
            for leg in 0..LEGS {
                prop_assert!((closed.leg_angles[leg].to_rad() - joints.theta_rad[leg]).abs() < 1e-12);
            }
        }
    }
}
