//! The three equations with the sides squared: the form in which they are bilinear in the legs'
//! headings, and therefore the one to eliminate in, to iterate on fast and to certify.
//!
//! Side k joins leg i = k to leg j = k + 1. With c = Bᵢ − Bⱼ and v̂ the inward directions,
//!
//! gₖ = (|AᵢAⱼ|² − Lₖ²) / 2lᵢlⱼ = κ + p cos θᵢ + q cos θⱼ − ω cos θᵢ cos θⱼ − sin θᵢ sin θⱼ,
//!
//! κ = (|c|² + lᵢ² + lⱼ² − Lₖ²) / 2lᵢlⱼ, p = v̂ᵢ·c / lⱼ, q = −v̂ⱼ·c / lᵢ, ω = v̂ᵢ·v̂ⱼ.
//!
//! gₖ = 0 exactly where the seed's fₖ = 0 (eq. 1). Nothing here knows which solution is wanted; the
//! seed's own form of the equations is [`Equations`](super::Equations).

use masseter_shared::geometry::{Actuators, LEGS, Mechanism};

use super::heading::Heading;

/// Roundings of gₖ and of its derivatives, in units of the machine epsilon times |κ| + |p| + |q| + 2:
/// at most 12 operations on terms no larger than that, with headings 2 roundings off the circle.
pub(super) const ROUNDINGS: f64 = 16.0;
/// No Newton step is longer; a longer one says only that the Jacobian is nearly singular.
const LONGEST_STEP_RAD: f64 = 1.0;

/// The coefficients of one gₖ; unitless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Side {
    pub constant: f64,
    pub near_cos: f64,
    pub far_cos: f64,
    pub cos_cos: f64,
    /// 2lᵢlⱼ, m²: what gₖ is multiplied by to become a difference of squares.
    pub unit_m2: f64,
    pub length_m: f64,
    /// What the computed gₖ may be off by.
    pub rounding: f64,
}

/// The equations for one input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Closure {
    pub(super) sides: [Side; LEGS],
    pub(super) leg_m: [f64; LEGS],
}

/// Values and derivatives of the three gₖ at one set of headings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Closing {
    pub value: [f64; LEGS],
    /// ∂gₖ/∂θₖ.
    pub near: [f64; LEGS],
    /// ∂gₖ/∂θₖ₊₁.
    pub far: [f64; LEGS],
}

/// Where an iteration ended with every gₖ zero but for rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Closed {
    pub headings: [Heading; LEGS],
    pub closing: Closing,
    pub iterations: u32,
}

impl Side {
    fn new(mechanism: &Mechanism, actuators: &Actuators, near: usize) -> Self {
        let far = next(near);
        let (near_m, far_m) = (actuators.leg_m[near], actuators.leg_m[far]);
        let (inward, far_inward) = (mechanism.inward_direction(near), mechanism.inward_direction(far));
        let hinges =
            mechanism.hinge(near, actuators.slide_m[near]) - mechanism.hinge(far, actuators.slide_m[far]);
        let (unit_m2, length_m) = (2.0 * near_m * far_m, mechanism.platform_sides_m()[near]);
        let squares = hinges.norm_squared() + near_m * near_m + far_m * far_m - length_m * length_m;
        let constant = squares / unit_m2;
        let near_cos = inward.dot(&hinges) / far_m;
        let far_cos = -far_inward.dot(&hinges) / near_m;
        // |ω| ≤ 1, so no term of gₖ or of its derivatives is larger than this sum.
        let scale = constant.abs() + near_cos.abs() + far_cos.abs() + 2.0;
        Self {
            constant,
            near_cos,
            far_cos,
            cos_cos: inward.dot(&far_inward),
            unit_m2,
            length_m,
            rounding: ROUNDINGS * f64::EPSILON * scale,
        }
    }

    pub(super) fn value(&self, near: Heading, far: Heading) -> f64 {
        self.constant + self.near_cos * near.cos + self.far_cos * far.cos
            - self.cos_cos * near.cos * far.cos
            - near.sin * far.sin
    }

    fn near_derivative(&self, near: Heading, far: Heading) -> f64 {
        near.sin * (self.cos_cos * far.cos - self.near_cos) - near.cos * far.sin
    }

    fn far_derivative(&self, near: Heading, far: Heading) -> f64 {
        far.sin * (self.cos_cos * near.cos - self.far_cos) - far.cos * near.sin
    }

    /// fₖ = |AᵢAⱼ| − Lₖ for a value of gₖ, metres.
    fn excess_m(&self, value: f64) -> f64 {
        let difference_m2 = value * self.unit_m2;
        difference_m2 / ((self.length_m * self.length_m + difference_m2).max(0.0).sqrt() + self.length_m)
    }
}

impl Closure {
    /// The equations for an input in metres. No leg may have length zero.
    pub(super) fn new(mechanism: &Mechanism, actuators: &Actuators) -> Self {
        Self {
            sides: std::array::from_fn(|side| Side::new(mechanism, actuators, side)),
            leg_m: actuators.leg_m,
        }
    }

    pub(super) fn evaluate(&self, headings: &[Heading; LEGS]) -> Closing {
        let at = |formula: fn(&Side, Heading, Heading) -> f64| {
            std::array::from_fn(|side| formula(&self.sides[side], headings[side], headings[next(side)]))
        };
        Closing { value: at(Side::value), near: at(Side::near_derivative), far: at(Side::far_derivative) }
    }

    /// Newton's iteration from these headings; none when `max_iterations` do not close the platform.
    pub(super) fn close(&self, start: &[Heading; LEGS], max_iterations: u32) -> Option<Closed> {
        let mut headings = *start;
        for iterations in 0..=max_iterations {
            let closing = self.evaluate(&headings);
            if self.is_closed(&closing) {
                return Some(Closed { headings, closing, iterations });
            }
            let step_rad = closing.newton_step_rad();
            headings = std::array::from_fn(|leg| headings[leg].stepped(step_rad[leg]));
        }
        None
    }

    fn is_closed(&self, closing: &Closing) -> bool {
        closing.value.iter().zip(&self.sides).all(|(value, side)| value.abs() <= side.rounding)
    }

    /// The largest |fₖ|, metres.
    pub(super) fn residual_m(&self, closing: &Closing) -> f64 {
        let excess_m = |side: usize| self.sides[side].excess_m(closing.value[side]).abs();
        (0..LEGS).map(excess_m).fold(0.0, f64::max)
    }

    /// [`Equations::determinant`](super::Equations::determinant) where the platform is closed.
    pub(super) fn determinant(&self, closing: &Closing) -> f64 {
        let legs: f64 = self.leg_m.iter().product();
        let sides: f64 = self.sides.iter().map(|side| side.length_m).product();
        closing.determinant() * legs / sides
    }
}

impl Closing {
    /// Determinant of ∂g/∂θ.
    pub(super) fn determinant(&self) -> f64 {
        self.near.iter().product::<f64>() + self.far.iter().product::<f64>()
    }

    /// Inverse of ∂g/∂θ: row for the leg, column for the side. Every cofactor is a single product, so
    /// but for the determinant's rounding, common to all, each entry is right to two roundings.
    pub(super) fn inverse(&self) -> [[f64; LEGS]; LEGS] {
        let ([a, b, c], [d, e, f]) = (self.near, self.far);
        let scale = 1.0 / self.determinant();
        [[b * c, -c * d, d * e], [e * f, a * c, -a * e], [-b * f, d * f, a * b]]
            .map(|row| row.map(|cofactor| cofactor * scale))
    }

    /// −(∂g/∂θ)⁻¹ g, bounded; zero where the Jacobian has no inverse.
    fn newton_step_rad(&self) -> [f64; LEGS] {
        self.inverse().map(|row| {
            let step = -(row[0] * self.value[0] + row[1] * self.value[1] + row[2] * self.value[2]);
            if step.is_nan() { 0.0 } else { step.clamp(-LONGEST_STEP_RAD, LONGEST_STEP_RAD) }
        })
    }
}

/// The leg at the far end of the side that starts at this one.
pub(super) fn next(leg: usize) -> usize {
    (leg + 1) % LEGS
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::Equations;
    use crate::kinematics::samples::{mechanisms, poses};

    proptest! {
        #[test]
        fn it_agrees_with_the_seeds_form_of_the_equations(
            mechanism in mechanisms(), pose in poses(25.0), off in -0.5..0.5f64,
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let closure = Closure::new(&mechanism, &joints.actuators);
            let equations = Equations::new(&mechanism, &joints.actuators);
            let solved = closure.evaluate(&joints.theta_rad.map(Heading::from_rad));
            prop_assert!(closure.is_closed(&solved));
            let determinant = equations.determinant(&equations.evaluate(joints.theta_rad.into()));
            prop_assert!((closure.determinant(&solved) - determinant).abs() < 1e-12);
            let theta_rad = [joints.theta_rad[0] + off, joints.theta_rad[1], joints.theta_rad[2] - off];
            let away = closure.evaluate(&theta_rad.map(Heading::from_rad));
            let expected = equations.evaluate(theta_rad.into());
            prop_assert!((closure.residual_m(&away) - expected.residual_norm_m()).abs() < 1e-14);
        }

        #[test]
        fn the_inverse_inverts_the_derivatives(
            mechanism in mechanisms(), pose in poses(25.0),
        ) {
            let joints = mechanism.inverse(&pose).unwrap();
            let closure = Closure::new(&mechanism, &joints.actuators);
            let at = |theta_rad: [f64; LEGS]| closure.evaluate(&theta_rad.map(Heading::from_rad));
            let here = at(joints.theta_rad);
            prop_assume!(closure.determinant(&here).abs() > 1e-3);
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
            let closure = Closure::new(&mechanism, &joints.actuators);
            let at = closure.evaluate(&joints.theta_rad.map(Heading::from_rad));
            prop_assume!(closure.determinant(&at).abs() > 0.3);
            let start = std::array::from_fn(|leg| Heading::from_rad(joints.theta_rad[leg] + off[leg]));
            let closed = closure.close(&start, 5).unwrap();
            prop_assert!(closed.iterations <= 5 && closure.residual_m(&closed.closing) < 1e-13);
            for leg in 0..LEGS {
                prop_assert!((closed.headings[leg].to_rad() - joints.theta_rad[leg]).abs() < 1e-12);
            }
        }
    }
}
