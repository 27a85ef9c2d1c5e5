//! A leg's angle as a point on the unit circle, so that iterating needs no sine and no cosine.

use masseter_shared::geometry::LEGS;

/// (cos θ, sin θ) of one leg in its plane: cos inward, sin up. Unit length within 2 roundings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Heading {
    /// cos θ.
    pub cos: f64,
    /// sin θ.
    pub sin: f64,
}

impl Heading {
    /// From an angle in radians.
    pub(super) fn from_rad(theta_rad: f64) -> Self {
        let (sin, cos) = theta_rad.sin_cos();
        Self { cos, sin }
    }

    /// The angle in (−π, π], radians.
    pub(super) fn to_rad(self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// Moved along the tangent by `step_rad` and back onto the circle: turned by atan(step), which is
    /// the step up to its third power and never past a right angle.
    #[must_use]
    pub(super) fn stepped(self, step_rad: f64) -> Self {
        let (cos, sin) = (self.cos - self.sin * step_rad, self.sin + self.cos * step_rad);
        let to_unit = 1.0 / (cos * cos + sin * sin).sqrt();
        Self { cos: cos * to_unit, sin: sin * to_unit }
    }

    /// The same angle below the base: −θ.
    #[must_use]
    pub(super) fn mirrored(self) -> Self {
        Self { cos: self.cos, sin: -self.sin }
    }

    /// The angle between two headings, in [0, π], radians.
    pub(super) fn angle_to(self, other: Self) -> f64 {
        let along = self.cos * other.cos + self.sin * other.sin;
        let across = self.cos * other.sin - self.sin * other.cos;
        across.abs().atan2(along)
    }
}

/// Whether no leg's angle differs by more than a small angle, radians; compares chords, which needs
/// no arc tangent.
pub(super) fn coincide(a: &[Heading; LEGS], b: &[Heading; LEGS], within_rad: f64) -> bool {
    a.iter().zip(b).all(|(a, b)| (a.cos - b.cos).hypot(a.sin - b.sin) <= within_rad)
}

/// How far apart two sets of leg angles are: the largest difference of any leg, radians.
pub(super) fn separation_rad(a: &[Heading; LEGS], b: &[Heading; LEGS]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.angle_to(*b)).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn a_step_turns_by_its_arc_tangent(theta in -3.1..3.1f64, step in -2.0..2.0f64) {
            let start = Heading::from_rad(theta);
            let end = start.stepped(step);
            prop_assert!((start.angle_to(end) - step.abs().atan()).abs() < 1e-15);
            prop_assert!((end.cos.hypot(end.sin) - 1.0).abs() < 4.0 * f64::EPSILON);
            prop_assert!((start.to_rad() - theta).abs() < 1e-15);
            prop_assert!((start.mirrored().to_rad() + theta).abs() < 1e-15);
        }
    }
}
