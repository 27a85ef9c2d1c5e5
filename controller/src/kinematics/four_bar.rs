//! The two four-bar chains that leg 1 drives: base, leg 1, side 12, leg 2, and base, leg 1, side 31,
//! leg 3. At a given θ₁ each leaves its other leg two leg angles.
//!
//! With x = cos θ₁ and y = sin θ₁ the side's equation reads A + B cos θ + C sin θ = 0, where A and B
//! are affine in x and C = −y: a line that cuts the unit circle where D = B² + C² − A² ≥ 0. D is a
//! quadratic in x whose leading coefficient ω² − 1 − p² is never positive, so the angles at which a
//! chain closes are *one* interval of x. The third side is not part of this module.

use super::leg_angle::LegAngle;
use super::loop_equations::PlatformSide;

/// A closed interval; empty when its ends are not in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub low: f64,
    pub high: f64,
}

/// The side's equation as a line in the plane of the driven leg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FourBar {
    /// A at x = 0, and its slope.
    offset: [f64; 2],
    /// B at x = 0, and its slope.
    along: [f64; 2],
}

/// The driven leg's angles at one θ₁.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Branches {
    /// The two leg angles; equal at the ends of the interval, where the chain is stretched or folded.
    pub leg_angles: [LegAngle; 2],
    /// B² + C²: the denominator of the leg angles.
    pub norm_squared: f64,
}

impl Interval {
    pub(super) fn width(&self) -> f64 {
        self.high - self.low
    }

    pub(super) fn intersect(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    /// The point at a fraction of the way from low to high.
    pub(super) fn at(&self, fraction: f64) -> f64 {
        self.low + self.width() * fraction
    }
}

impl FourBar {
    /// Of the side that leaves the driving leg.
    pub(super) fn driven_from_near(side: &PlatformSide) -> Self {
        Self { offset: [side.constant, side.near_cos], along: [side.far_cos, -side.cos_cos] }
    }

    /// Of the side that arrives at the driving leg.
    pub(super) fn driven_from_far(side: &PlatformSide) -> Self {
        Self { offset: [side.constant, side.far_cos], along: [side.near_cos, -side.cos_cos] }
    }

    /// The x = cos θ₁ in [−1, 1] at which the chain closes.
    pub(super) fn range(&self) -> Interval {
        let ([a, a_slope], [b, b_slope]) = (self.offset, self.along);
        // Kept below zero: what is zero but for rounding must still open downward.
        let leading = (b_slope * b_slope - 1.0 - a_slope * a_slope).min(-f64::MIN_POSITIVE);
        let half_linear = b * b_slope - a * a_slope;
        let constant = b * b + 1.0 - a * a;
        let discriminant = half_linear * half_linear - leading * constant;
        if discriminant.is_nan() || discriminant < 0.0 {
            return Interval { low: 1.0, high: -1.0 };
        }
        let sum = -(half_linear + discriminant.sqrt().copysign(half_linear));
        let (one, other) = (sum / leading, constant / sum);
        Interval { low: one.min(other), high: one.max(other) }.intersect(Interval { low: -1.0, high: 1.0 })
    }

    /// Both leg angles of the driven leg; outside the range the one that comes closest, twice.
    #[inline]
    pub(super) fn branches(&self, driving: LegAngle) -> Branches {
        let offset = self.offset[0] + self.offset[1] * driving.cos;
        let (along, across) = (self.along[0] + self.along[1] * driving.cos, -driving.sin);
        let norm_squared = along * along + across * across;
        let discriminant = norm_squared - offset * offset;
        if discriminant <= 0.0 {
            return Branches {
                leg_angles: [closest(offset, along, across, norm_squared.sqrt()); 2],
                norm_squared,
            };
        }
        let (root, per_norm_squared) = (discriminant.sqrt(), 1.0 / norm_squared);
        let (foot, off) = (-offset * per_norm_squared, root * per_norm_squared);
        let (foot_cos, foot_sin, off_cos, off_sin) = (foot * along, foot * across, off * across, off * along);
        let leg_angles = [
            LegAngle { cos: foot_cos - off_cos, sin: foot_sin + off_sin },
            LegAngle { cos: foot_cos + off_cos, sin: foot_sin - off_sin },
        ];
        Branches { leg_angles, norm_squared }
    }
}

/// The point of the circle next to a line that misses or touches it.
fn closest(offset: f64, along: f64, across: f64, norm: f64) -> LegAngle {
    let to_unit = -1f64.copysign(offset) / norm.max(f64::MIN_POSITIVE);
    LegAngle { cos: along * to_unit, sin: across * to_unit }
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Actuators;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::loop_equations::LoopEquations;
    use crate::kinematics::tests::mechanisms;

    proptest! {
        #[test]
        fn within_the_range_both_headings_close_the_chain_and_outside_none_does(
            mechanism in mechanisms(),
            axes in [-0.03..0.03f64, -0.03..0.03f64, -0.03..0.03f64, 0.2..0.35f64, 0.2..0.35f64, 0.2..0.35f64],
            theta in -3.1..3.1f64,
        ) {
            let loops = LoopEquations::new(&mechanism, &Actuators::from_axes(axes));
            let driving = LegAngle::from_rad(theta);
            let chains = [
                (FourBar::driven_from_near(&loops.sides[0]), 0),
                (FourBar::driven_from_far(&loops.sides[2]), 2),
            ];
            for (chain, side) in chains {
                let range = chain.range();
                let inside = range.low < driving.cos && driving.cos < range.high;
                for leg_angle in chain.branches(driving).leg_angles {
                    let (near, far) = if side == 0 { (driving, leg_angle) } else { (leg_angle, driving) };
                    let value = loops.sides[side].value(near, far);
                    prop_assert_eq!(inside, value.abs() < 1e-13, "{}", value);
                }
            }
        }
    }
}
