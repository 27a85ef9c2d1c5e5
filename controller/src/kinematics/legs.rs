//! The three legs and the three sides of the platform, in cyclic order. A leg's angle is a point on the unit circle, so an
//! iteration needs no sine and no cosine.

use masseter_model::geometry::LEGS;

/// One value for each leg or side. The compiler does not unroll `array::map` and `from_fn` here, and then passes
/// everything through memory: a quarter of a warm solve's time.
#[inline]
pub(super) fn each<T>(value: impl Fn(usize) -> T) -> [T; LEGS] {
    [value(0), value(1), value(2)]
}

/// The leg at the far end of the side that starts at this one.
#[inline]
pub(super) fn next(leg: usize) -> usize {
    (leg + 1) % LEGS
}

/// Largest difference e of a square from 1 for the series of 1/√(1 + e). The first omitted term, 5e³/16, is then a
/// tenth of a rounding.
const SERIES_SUFFICES: f64 = 4e-6;

/// Largest sine x for five terms of the arc sine's series. The sixth term, 0.022 x¹¹, is then less than a rounding of
/// x.
const SERIES_REACHES: f64 = 0.03;

/// (cos θ, sin θ) of one leg in its plane: cos inward, sin up. Unit length within 2 roundings.
#[doc(alias("passive joint angle", "hinge angle"))]
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LegAngle {
    /// cos θ.
    pub cos: f64,
    /// sin θ.
    pub sin: f64,
}

impl LegAngle {
    /// From an angle in radians.
    pub(super) fn from_rad(theta_rad: f64) -> Self {
        let (sin, cos) = theta_rad.sin_cos();
        Self { cos, sin }
    }

    /// The angle in (−π, π], radians.
    pub(super) fn to_rad(self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// The angle moved along the tangent by `step_rad` and back onto the circle. The turn is atan(step): the step up to
    /// its third power, and never past a right angle.
    #[must_use]
    #[inline]
    pub(super) fn stepped(self, step_rad: f64) -> Self {
        let (cos, sin) = (self.cos - self.sin * step_rad, self.sin + self.cos * step_rad);
        let excess = cos * cos + sin * sin - 1.0;
        let to_unit = if excess.abs() < SERIES_SUFFICES {
            1.0 - excess * (0.5 - 0.375 * excess)
        } else {
            1.0 / (1.0 + excess).sqrt()
        };
        Self { cos: cos * to_unit, sin: sin * to_unit }
    }

    /// The same angle below the base: −θ.
    #[must_use]
    pub(super) fn mirrored(self) -> Self {
        Self { cos: self.cos, sin: -self.sin }
    }

    /// The angle between two leg angles, in [0, π], radians.
    pub(super) fn angle_to(self, other: Self) -> f64 {
        self.sine_to(other).abs().atan2(self.cosine_to(other))
    }

    /// The sine of the turn from this leg angle to another.
    #[inline]
    fn sine_to(self, other: Self) -> f64 {
        self.cos * other.sin - self.sin * other.cos
    }

    /// Its cosine.
    #[inline]
    fn cosine_to(self, other: Self) -> f64 {
        self.cos * other.cos + self.sin * other.sin
    }
}

/// Leg angles with known values in radians. Near values follow to 3 roundings, without an arc tangent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Anchor {
    leg_angles: [LegAngle; LEGS],
    theta_rad: [f64; LEGS],
}

impl Anchor {
    /// Near nothing.
    pub(super) fn nowhere() -> Self {
        Self { leg_angles: [LegAngle { cos: 0.0, sin: 0.0 }; LEGS], theta_rad: [0.0; LEGS] }
    }

    /// The angles in radians. A leg too far away sets a new anchor.
    #[inline]
    pub(super) fn angles_rad(&mut self, leg_angles: &[LegAngle; LEGS]) -> [f64; LEGS] {
        let sines = each(|leg| self.leg_angles[leg].sine_to(leg_angles[leg]));
        let are_near = each(|leg| {
            sines[leg].abs() < SERIES_REACHES && self.leg_angles[leg].cosine_to(leg_angles[leg]) > 0.0
        });
        if are_near != [true; LEGS] {
            *self = Self { leg_angles: *leg_angles, theta_rad: leg_angles.map(LegAngle::to_rad) };
            return self.theta_rad;
        }
        each(|leg| self.theta_rad[leg] + arc_sine(sines[leg]))
    }
}

/// The arc sine of a number smaller than [`SERIES_REACHES`].
#[inline]
fn arc_sine(x: f64) -> f64 {
    let square = x * x;
    let fourth = 15.0 / 336.0 + square * (105.0 / 3456.0);
    x + x * square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * fourth))
}

/// Whether no leg's angle differs by more than a small angle, radians. The comparison of chords needs no arc tangent.
pub(super) fn coincide(a: &[LegAngle; LEGS], b: &[LegAngle; LEGS], within_rad: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| {
        let (cos, sin) = (a.cos - b.cos, a.sin - b.sin);
        cos * cos + sin * sin <= within_rad * within_rad
    })
}

/// Distance of two sets of leg angles: the largest difference of any leg, radians.
pub(super) fn separation_rad(a: &[LegAngle; LEGS], b: &[LegAngle; LEGS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.angle_to(*b)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn angles_by_an_anchor_are_those_of_the_arc_tangent(
            theta in prop::array::uniform3(-3.0..3.0f64),
            near in prop::array::uniform3(-0.04..0.04f64),
            far in prop::array::uniform3(-3.0..3.0f64),
        ) {
            let mut anchor = Anchor::nowhere();
            let nearby = std::array::from_fn(|leg| theta[leg] + near[leg]);
            for angles in [theta, nearby, far, theta.map(|angle| angle / 2.0 - 1.6)] {
                let leg_angles = angles.map(LegAngle::from_rad);
                for (angle, leg_angle) in anchor.angles_rad(&leg_angles).into_iter().zip(leg_angles) {
                    prop_assert!((angle - leg_angle.to_rad()).abs() <= 4.0 * f64::EPSILON);
                }
            }
        }

        #[test]
        fn a_step_turns_by_its_arc_tangent(theta in -3.1..3.1f64, step in -2.0..2.0f64) {
            let start = LegAngle::from_rad(theta);
            let end = start.stepped(step);
            prop_assert!((start.angle_to(end) - step.abs().atan()).abs() < 1e-15);
            prop_assert!((end.cos.hypot(end.sin) - 1.0).abs() < 4.0 * f64::EPSILON);
            prop_assert!((start.to_rad() - theta).abs() < 1e-15);
            prop_assert!((start.mirrored().to_rad() + theta).abs() < 1e-15);
        }
    }
}
