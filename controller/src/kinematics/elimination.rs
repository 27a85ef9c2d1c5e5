//! Every set of leg angles that closes the platform, by elimination of two of the three.
//!
//! At a given θ₁ legs 2 and 3 have two possible angles each ([`FourBar`]); side 23 decides which of the four
//! pairs close. With Nⱼ = Bⱼ² + Cⱼ² the product over the pairs is
//!
//! r(x) = (N₂ N₃)² ∏ g₂₃, x = cos θ₁.
//!
//! r is a polynomial of degree 8 in x:
//! - It is symmetric in both pairs of leg angles, hence a polynomial in the coefficients of the two lines.
//! - By Poisson's formula the product over the two angles of one leg has the denominator Nⱼ and a numerator
//!   quadratic in Aⱼ, Bⱼ, Cⱼ. So r has degree 8 in (cos θ₁, sin θ₁).
//! - Mirroring all legs does not change r, so the degree in x is 8, too: the known 16 solutions in 8
//!   mirrored pairs.
//!
//! Completeness: at every real solution both chains close, so x lies in the one interval where both do, and r(x) = 0.
//! Nine values determine r there. Each is a product of four g₂₃; a g₂₃ cancels near a solution, so its error is that of
//! its terms. [`bernstein`](super::bernstein) gets the largest such error and reports every place where r can be zero.
//! This is not proven. Tests against random starts, dense grids and walks towards singular poses find no exception.
//!
//! An isolated zero changes the sign of g₂₃ of exactly one pair. Newton's iteration follows that pair; the result
//! counts if its x lies in the interval. Elsewhere the iteration starts from three points for every pair. Such places
//! are those of several zeros, and those with r smaller than its rounding. The neutral input has such triple zeros,
//! which belong to three pairs. If these starts reach no solution, or a nearly singular one, more starts follow. An
//! iteration on the three equations polishes each result, so all results are solutions.
//!
//! Next to a singularity two solutions lie close together. [`solutions`](super::solutions) looks for the second
//! from the first. If rounding does not separate the two, both are reported without a certificate.

use super::bernstein::{Interval, NODES, Vanishing, Zeros, locate};
use super::legs::LegAngle;
use super::loop_equations::{LoopEquations, LoopSolution, PlatformSide};

/// Iterations that polish a solution: where two solutions meet, each iteration only halves the error.
const MOST_ITERATIONS: u32 = 40;
/// Steps that narrow a change of sign; half of them gain several digits each.
const MOST_STEPS: u32 = 50;
/// Iterations for a near solution. If they do not suffice, the bracket of the sign change shrinks first.
const FEW_ITERATIONS: u32 = 6;
/// g₂₃ at which Newton's iteration takes over for good.
const NARROW_ENOUGH: f64 = 1e-10;
/// Below this determinant ([`LoopEquations::determinant`]) another solution may be close.
pub(super) const NEARLY_SINGULAR: f64 = 1e-2;
/// Width of a range of x below which the search goes by pieces: rounding hides r, and also whether the range is empty.
const NARROW: f64 = 1e-8;
/// Share of the range above which the search of an undecided interval goes by pieces.
const WIDE: f64 = 1.0 / 512.0;
const PIECES: u32 = 16;
/// Pairs of leg angles of legs 2 and 3.
const PAIRS: usize = 4;

/// The filter of the followed solutions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum SolutionFilter {
    /// Every solution.
    All,
    /// Solutions with a positive determinant, as a true solution has; the search may also find others.
    PositiveDeterminant,
}

/// One of the two four-bar chains that leg 1 drives: base, leg 1, side 12, leg 2, or base, leg 1, side 31, leg 3.
///
/// The angles at which a chain closes are *one* interval of x = cos θ₁.
///
/// The side's equation is A + B cos θ + C sin θ = 0: a line in the plane of the driven leg. A and B are affine in x, and
/// C = −y = −sin θ₁. The line cuts the unit circle where D = B² + C² − A² ≥ 0. D is a quadratic in x. Its leading
/// coefficient ω² − 1 − p² is never positive.
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
        // Kept below zero: a coefficient that is zero except for rounding must still open downward.
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

    /// Both leg angles of the driven leg; outside the range the closest angle, twice.
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

/// r at one x.
struct Product {
    value: f64,
    rounding: f64,
}

/// Legs 2 and 3 as functions of x = cos θ₁, θ₁ in [0, π].
#[derive(Debug, Clone, Copy)]
pub(super) struct Elimination<'a> {
    loops: &'a LoopEquations<'a>,
    second: FourBar,
    third: FourBar,
}

impl<'a> Elimination<'a> {
    pub(super) fn new(loops: &'a LoopEquations<'a>) -> Self {
        Self {
            loops,
            second: FourBar::driven_from_near(&loops.sides[0]),
            third: FourBar::driven_from_far(&loops.sides[2]),
        }
    }

    /// Calls `found` for every solution of the filter with θ₁ in [0, π], for some more than once.
    pub(super) fn solve(
        &self,
        filter: SolutionFilter,
        mut found: impl FnMut(LoopSolution),
    ) -> Result<(), Vanishing> {
        let range = self.range();
        if range.width() < -NARROW {
            return Ok(());
        }
        if range.width() < NARROW {
            self.try_pieces(range, &mut found);
            return Ok(());
        }
        let products = NODES.map(|node| self.product(range.at(node)));
        let rounding =
            products.iter().fold(0.0, |most: f64, product| most.max(product.rounding)) / range.width().sqrt();
        locate(&products.map(|product| product.value), rounding, |zeros| match zeros {
            Zeros::One(within) => self.follow(filter, scaled(range, within), &mut found),
            Zeros::Undecided(within) => {
                let is_settled = self.try_all(scaled(range, within), &mut found);
                if !is_settled || within.width() > WIDE {
                    self.try_pieces(scaled(range, within), &mut found);
                }
            }
        })
    }

    /// The x at which both chains close.
    pub(super) fn range(&self) -> Interval {
        self.second.range().intersect(self.third.range())
    }

    /// The four sets of leg angles at x with the best fit of sides 12 and 31.
    pub(super) fn leg_angles(&self, x: f64) -> [[LegAngle; masseter_model::geometry::LEGS]; PAIRS] {
        let (driving, second, third) = self.branches(x);
        std::array::from_fn(|pair| [driving, second.leg_angles[pair & 1], third.leg_angles[pair >> 1]])
    }

    fn branches(&self, x: f64) -> (LegAngle, Branches, Branches) {
        let driving = LegAngle { cos: x, sin: ((1.0 - x) * (1.0 + x)).max(0.0).sqrt() };
        (driving, self.second.branches(driving), self.third.branches(driving))
    }

    /// r(x), and its change if every g₂₃ changes by one rounding.
    fn product(&self, x: f64) -> Product {
        let (values, norms) = self.residuals_23(x);
        let [a, b, c, d] = values.map(f64::abs);
        Product {
            value: norms * norms * (values[0] * values[1]) * (values[2] * values[3]),
            rounding: f64::EPSILON * norms * norms * (a * b * (c + d) + (a + b) * (c * d)),
        }
    }

    /// g₂₃ for each pair of leg angles, and N₂ N₃.
    fn residuals_23(&self, x: f64) -> ([f64; PAIRS], f64) {
        let (_, second, third) = self.branches(x);
        let value =
            |pair: usize| self.loops.sides[1].value(second.leg_angles[pair & 1], third.leg_angles[pair >> 1]);
        ([value(0), value(1), value(2), value(3)], second.norm_squared * third.norm_squared)
    }

    /// The solution in an interval that holds exactly one, if it passes the filter.
    fn follow(&self, filter: SolutionFilter, within: Interval, found: &mut impl FnMut(LoopSolution)) {
        let [(low, _), (high, _)] = [within.low, within.high].map(|x| self.residuals_23(x));
        let mut changing = (0..PAIRS).filter(|&pair| (low[pair] > 0.0) != (high[pair] > 0.0));
        let (Some(pair), None) = (changing.next(), changing.next()) else {
            self.try_all(within, found);
            return;
        };
        if filter == SolutionFilter::PositiveDeterminant
            && !has_positive_determinant(pair, low[pair] < high[pair])
        {
            return;
        }
        let first = crossing([within.low, within.high], [low[pair], high[pair]]);
        if let Some(closed) = self.loops.close(&self.leg_angles(first)[pair], FEW_ITERATIONS)
            && lies_within(within, &closed)
        {
            return found(closed);
        }
        let residual = |x| self.residuals_23(x).0[pair];
        let close_from = |x| self.loops.close(&self.leg_angles(x)[pair], MOST_ITERATIONS);
        // Next to a solution beyond the interval the residual is small too, so the iteration may find that solution
        // instead.
        let own = close_from(narrowed(within, low[pair], high[pair], residual));
        let own = own.filter(|closed| lies_within(within, closed));
        match own.or_else(|| close_from(bisected(within, low[pair], residual))) {
            Some(closed) => found(closed),
            None => {
                self.try_all(within, found);
            }
        }
    }

    /// Calls `found` for every solution that a pair reaches from the ends or the middle of an interval. True if there
    /// are any and all of them are regular.
    fn try_all(&self, within: Interval, found: &mut impl FnMut(LoopSolution)) -> bool {
        let (mut some, mut all_regular) = (false, true);
        for x in [within.low, within.at(0.5), within.high] {
            for start in self.leg_angles(x) {
                if let Some(closed) = self.loops.close(&start, MOST_ITERATIONS) {
                    some = true;
                    all_regular &= self.loops.determinant(&closed.residuals).abs() > NEARLY_SINGULAR;
                    found(closed);
                }
            }
        }
        some && all_regular
    }

    /// [`try_all`](Self::try_all) in each of many pieces: only a start next to a double zero leads to its solutions.
    fn try_pieces(&self, within: Interval, found: &mut impl FnMut(LoopSolution)) {
        for piece in 0..PIECES {
            let at = |end: u32| within.at(f64::from(piece + end) / f64::from(PIECES));
            self.try_all(Interval { low: at(0), high: at(1) }, found);
        }
    }
}

/// Whether the Jacobian's determinant is positive where g₂₃ of a pair crosses zero, rising or falling with x.
///
/// - Both chains stay closed, so its sign is that of ∂g₁₂/∂θ₂ · ∂g₃₁/∂θ₃ · dg₂₃/dx.
/// - Each of the first two factors is negative on a chain's first leg angle and positive on its second.
fn has_positive_determinant(pair: usize, rising: bool) -> bool {
    ((pair & 1) == (pair >> 1)) == rising
}

/// Whether a solution is the one of an interval: the test of its x is enough.
fn lies_within(interval: Interval, closed: &LoopSolution) -> bool {
    let driving = closed.leg_angles[0];
    driving.sin >= 0.0 && interval.low <= driving.cos && driving.cos <= interval.high
}

fn scaled(range: Interval, within: Interval) -> Interval {
    Interval { low: range.at(within.low), high: range.at(within.high) }
}

/// The zero of the straight line through two points.
fn crossing([kept, newest]: [f64; 2], [at_kept, at_newest]: [f64; 2]) -> f64 {
    newest - at_newest * (newest - kept) / (at_newest - at_kept)
}

/// The sign change of a function, to the last digit.
fn bisected(mut within: Interval, at_low: f64, function: impl Fn(f64) -> f64) -> f64 {
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = within.at(0.5);
        let end = if (function(middle) > 0.0) == (at_low > 0.0) { &mut within.low } else { &mut within.high };
        *end = middle;
    }
    within.at(0.5)
}

/// The sign change of a function, by false position with the Illinois rule.
fn narrowed(within: Interval, at_low: f64, at_high: f64, function: impl Fn(f64) -> f64) -> f64 {
    let ([mut kept, mut newest], [mut at_kept, mut at_newest]) =
        ([within.low, within.high], [at_low, at_high]);
    for _ in 0..MOST_STEPS {
        if at_newest.abs() < NARROW_ENOUGH {
            break;
        }
        let x = crossing([kept, newest], [at_kept, at_newest]);
        let value = function(x);
        if (value > 0.0) == (at_newest > 0.0) {
            at_kept *= 0.5;
        } else {
            (kept, at_kept) = (newest, at_newest);
        }
        (newest, at_newest) = (x, value);
    }
    newest
}

#[cfg(test)]
mod tests {
    use masseter_model::geometry::Actuators;
    use proptest::prelude::*;

    use super::*;
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

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// A solution that is not followed has a negative determinant, except for rounding. Some solutions with a
        /// negative determinant are followed: those of an interval with two solutions.
        #[test]
        fn no_solution_with_a_positive_determinant_is_passed_over(
            mechanism in mechanisms(),
            slide_m in prop::array::uniform3(-0.03..0.03f64), leg_m in prop::array::uniform3(0.24..0.3f64),
        ) {
            let loops = LoopEquations::new(&mechanism, &Actuators { slide_m, leg_m });
            let solved = |filter| {
                let mut all = Vec::new();
                Elimination::new(&loops).solve(filter, |closed| all.push(closed)).unwrap();
                all
            };
            let followed = solved(SolutionFilter::PositiveDeterminant);
            for closed in solved(SolutionFilter::All) {
                let determinant = loops.determinant(&closed.residuals);
                let is_followed = followed.contains(&closed);
                prop_assert!(is_followed || determinant < 1e-3, "{determinant}");
            }
        }
    }
}
