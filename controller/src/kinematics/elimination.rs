//! Every set of leg angles that closes the platform, by eliminating two of the three.
//!
//! At a given θ₁ legs 2 and 3 have two headings each ([`FourBar`]); side 23 decides which of the four
//! pairs close. With Nⱼ = Bⱼ² + Cⱼ² the product over the pairs,
//!
//! r(x) = (N₂ N₃)² ∏ g₂₃, x = cos θ₁,
//!
//! is symmetric in both pairs of headings, hence a polynomial in the coefficients of the two lines:
//! by Poisson's formula the product over the two headings of one leg has the denominator Nⱼ and a
//! numerator quadratic in Aⱼ, Bⱼ, Cⱼ. So r has degree 8 in (cos θ₁, sin θ₁), and as mirroring all
//! legs leaves it as it is, degree 8 in x: the known 16 solutions in 8 mirrored pairs.
//!
//! Completeness: at every real solution both chains close, so x lies in the one interval where both
//! do, and r(x) = 0. r is known there from nine values, each a product of four g₂₃. A g₂₃ cancels where a
//! solution is near, so a value is off by roundings of its terms, not of its own size.
//! [`bernstein`](super::bernstein) reports every place where r can be zero as long as these are small against
//! the largest of the nine values. That is not proven; tests against random starts and dense grids have found
//! no exception. Where one zero is isolated and, as it must, exactly one pair's g₂₃ changes sign, that pair is
//! followed to it: first by Newton's iteration, whose result is the one that belongs there if its x does.
//! Where another number of pairs does, where several zeros meet, or where the polynomial drowns in rounding, as
//! at the neutral input with its triple zeros, which belong to three different pairs of headings, every pair is
//! tried from three points. Each result is polished on the three equations themselves, so nothing that is no
//! solution is found.
//!
//! What rounding leaves open: two solutions closer than `MERGED_WITHIN_RAD` (of [`platforms`](super::platforms)) count
//! as one, and solutions that meet (the input is on a singularity) may be found or missed as a pair.

use masseter_shared::geometry::LEGS;

use super::bernstein::{NODES, Vanishing, Zeros, locate};
use super::closure::{Closed, Closure};
use super::four_bar::{Branches, FourBar, Interval};
use super::heading::Heading;

/// Iterations that polish a solution: where two meet, each only halves the error.
const MOST_ITERATIONS: u32 = 40;
/// Steps that narrow a change of sign; half of them gain several digits each.
const MOST_STEPS: u32 = 50;
/// Iterations for a solution that is near; where they do not suffice, the change of sign is narrowed.
const FEW_ITERATIONS: u32 = 6;
/// g₂₃ at which Newton's iteration takes over for good.
const NARROW_ENOUGH: f64 = 1e-10;
/// Pairs of headings of legs 2 and 3.
const PAIRS: usize = 4;

/// Which solutions are worth following.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Each.
    All,
    /// Those with a positive determinant, which a true one has; others may be found as well.
    PositiveDeterminant,
}

/// Legs 2 and 3 as functions of x = cos θ₁, θ₁ in [0, π].
#[derive(Debug, Clone, Copy)]
pub(super) struct Elimination<'a> {
    closure: &'a Closure<'a>,
    second: FourBar,
    third: FourBar,
}

impl<'a> Elimination<'a> {
    pub(super) fn new(closure: &'a Closure<'a>) -> Self {
        Self {
            closure,
            second: FourBar::driven_from_near(&closure.sides[0]),
            third: FourBar::driven_from_far(&closure.sides[2]),
        }
    }

    /// Calls `found` for every wanted solution with θ₁ in [0, π], for some more than once.
    pub(super) fn solve(&self, wanted: Wanted, mut found: impl FnMut(Closed)) -> Result<(), Vanishing> {
        let range = self.range();
        if range.low > range.high {
            return Ok(());
        }
        let mut values = NODES;
        for value in &mut values {
            *value = self.product(range.at(*value));
        }
        locate(&values, |zeros| match zeros {
            Zeros::One(within) => self.follow(wanted, scaled(range, within), &mut found),
            Zeros::Undecided(within) => self.try_all(scaled(range, within), &mut found),
        })
    }

    /// The x at which both chains close.
    pub(super) fn range(&self) -> Interval {
        self.second.range().intersect(self.third.range())
    }

    /// The four sets of headings at x, on which sides 12 and 31 fit, or come closest to it.
    pub(super) fn headings(&self, x: f64) -> [[Heading; LEGS]; PAIRS] {
        let (driving, second, third) = self.branches(x);
        std::array::from_fn(|pair| [driving, second.headings[pair & 1], third.headings[pair >> 1]])
    }

    fn branches(&self, x: f64) -> (Heading, Branches, Branches) {
        let driving = Heading { cos: x, sin: ((1.0 - x) * (1.0 + x)).max(0.0).sqrt() };
        (driving, self.second.branches(driving), self.third.branches(driving))
    }

    /// r(x).
    fn product(&self, x: f64) -> f64 {
        let (_, second, third) = self.branches(x);
        let values = self.values(&second, &third);
        let norms = second.norm_squared * third.norm_squared;
        norms * norms * (values[0] * values[1]) * (values[2] * values[3])
    }

    /// g₂₃ for each pair of headings.
    fn closing_values(&self, x: f64) -> [f64; PAIRS] {
        let (_, second, third) = self.branches(x);
        self.values(&second, &third)
    }

    fn values(&self, second: &Branches, third: &Branches) -> [f64; PAIRS] {
        let value =
            |pair: usize| self.closure.sides[1].value(second.headings[pair & 1], third.headings[pair >> 1]);
        [value(0), value(1), value(2), value(3)]
    }

    /// The solution in an interval that holds exactly one, if it is wanted.
    fn follow(&self, wanted: Wanted, within: Interval, found: &mut impl FnMut(Closed)) {
        let (low, high) = (self.closing_values(within.low), self.closing_values(within.high));
        let mut changing = (0..PAIRS).filter(|&pair| (low[pair] > 0.0) != (high[pair] > 0.0));
        let (Some(pair), None) = (changing.next(), changing.next()) else {
            return self.try_all(within, found);
        };
        if wanted == Wanted::PositiveDeterminant && !has_positive_determinant(pair, low[pair] < high[pair]) {
            return;
        }
        let first = crossing([within.low, within.high], [low[pair], high[pair]]);
        if let Some(closed) = self.closure.close(&self.headings(first)[pair], FEW_ITERATIONS)
            && lies_within(within, &closed)
        {
            return found(closed);
        }
        let x = narrowed(within, low[pair], high[pair], |x| self.closing_values(x)[pair]);
        match self.closure.close(&self.headings(x)[pair], MOST_ITERATIONS) {
            Some(closed) => found(closed),
            None => self.try_all(within, found),
        }
    }

    /// Every solution to which a pair leads from the ends or the middle of an interval.
    fn try_all(&self, within: Interval, found: &mut impl FnMut(Closed)) {
        for x in [within.low, within.at(0.5), within.high] {
            for start in self.headings(x) {
                self.closure.close(&start, MOST_ITERATIONS).into_iter().for_each(&mut *found);
            }
        }
    }
}

/// The sign of the Jacobian's determinant where g₂₃ of a pair crosses zero, rising or falling with x: as
/// both chains stay closed, it is that of ∂g₁₂/∂θ₂ · ∂g₃₁/∂θ₃ · dg₂₃/dx, and each of the first two is
/// negative on a chain's first heading and positive on its second.
fn has_positive_determinant(pair: usize, rising: bool) -> bool {
    ((pair & 1) == (pair >> 1)) == rising
}

/// Whether a solution is the one that an interval holds: it is enough that its x lies there.
fn lies_within(interval: Interval, closed: &Closed) -> bool {
    let driving = closed.headings[0];
    driving.sin >= 0.0 && interval.low <= driving.cos && driving.cos <= interval.high
}

fn scaled(range: Interval, within: Interval) -> Interval {
    Interval { low: range.at(within.low), high: range.at(within.high) }
}

/// Where the straight line through two points crosses zero.
fn crossing([kept, newest]: [f64; 2], [at_kept, at_newest]: [f64; 2]) -> f64 {
    newest - at_newest * (newest - kept) / (at_newest - at_kept)
}

/// Where a function changes sign, by false position with the Illinois rule.
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
    use masseter_shared::geometry::Actuators;
    use proptest::prelude::*;

    use super::*;
    use crate::kinematics::samples::mechanisms;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// What is not followed has a negative determinant, but for rounding. Of those that have one, some are
        /// followed none the less: where two solutions lie in one interval.
        #[test]
        fn no_solution_with_a_positive_determinant_is_passed_over(
            mechanism in mechanisms(),
            slide_m in prop::array::uniform3(-0.03..0.03f64), leg_m in prop::array::uniform3(0.24..0.3f64),
        ) {
            let closure = Closure::new(&mechanism, &Actuators { slide_m, leg_m });
            let solved = |wanted| {
                let mut all = Vec::new();
                Elimination::new(&closure).solve(wanted, |closed| all.push(closed)).unwrap();
                all
            };
            let followed = solved(Wanted::PositiveDeterminant);
            for closed in solved(Wanted::All) {
                let determinant = closure.determinant(&closed.closing);
                let is_followed = followed.contains(&closed);
                prop_assert!(is_followed || determinant < 1e-3, "{determinant}");
            }
        }
    }
}
