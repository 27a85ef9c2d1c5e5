//! Outward-rounded interval arithmetic: every result contains all values of exact arithmetic for operands within the
//! given intervals.
//!
//! IEEE 754 rounds + − × ÷ √ to the nearest number, so the neighbour of the computed bound is an
//! outward bound. Transcendental functions are not provided. Bounds must be finite, as all lengths of a mechanism are.

use std::ops::{Add, Mul, Neg, Sub};

/// The real numbers from `low` to `high`, both included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Enclosure {
    pub low: f64,
    pub high: f64,
}

impl Enclosure {
    /// The interval between two ends, which must be finite and in order.
    pub(crate) fn new(low: f64, high: f64) -> Self {
        debug_assert!(low <= high && low.is_finite() && high.is_finite(), "[{low}, {high}]");
        Self { low, high }
    }

    /// A single number.
    pub(crate) fn point(value: f64) -> Self {
        Self::new(value, value)
    }

    /// A number about halfway between the ends, never outside them.
    pub(crate) fn middle(self) -> f64 {
        (0.5 * (self.low + self.high)).clamp(self.low, self.high)
    }

    /// About the distance of the ends.
    pub(crate) fn width(self) -> f64 {
        self.high - self.low
    }

    /// The largest absolute value.
    pub(crate) fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }

    /// Whether a number lies within.
    pub(crate) fn contains(self, value: f64) -> bool {
        self.low <= value && value <= self.high
    }

    /// The smallest interval that contains both.
    #[must_use]
    pub(crate) fn hull(self, other: Self) -> Self {
        Self::new(self.low.min(other.low), self.high.max(other.high))
    }

    /// The intersection.
    pub(crate) fn intersection(self, other: Self) -> Option<Self> {
        let (low, high) = (self.low.max(other.low), self.high.min(other.high));
        (low <= high).then(|| Self::new(low, high))
    }

    /// Both halves; they share the middle.
    pub(crate) fn halves(self) -> [Self; 2] {
        let middle = self.middle();
        [Self::new(self.low, middle), Self::new(middle, self.high)]
    }

    /// x².
    #[must_use]
    pub(crate) fn square(self) -> Self {
        let (a, b) = (self.low * self.low, self.high * self.high);
        let low = if self.contains(0.0) { 0.0 } else { a.min(b).next_down().max(0.0) };
        Self::new(low, a.max(b).next_up())
    }

    /// √x of the part that is not negative; none when all of the interval is negative.
    pub(crate) fn square_root(self) -> Option<Self> {
        let low = self.low.max(0.0).sqrt().next_down().max(0.0);
        (self.high >= 0.0).then(|| Self::new(low, self.high.sqrt().next_up()))
    }

    /// 1/x; the interval must be positive.
    pub(crate) fn reciprocal(self) -> Option<Self> {
        (self.low > 0.0).then(|| Self::new((1.0 / self.high).next_down(), (1.0 / self.low).next_up()))
    }
}

impl Add for Enclosure {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self::new((self.low + other.low).next_down(), (self.high + other.high).next_up())
    }
}

impl Sub for Enclosure {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Enclosure {
    type Output = Self;

    fn neg(self) -> Self {
        Self::new(-self.high, -self.low)
    }
}

impl Mul for Enclosure {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        let [a, b] = [self.low * other.low, self.low * other.high];
        let [c, d] = [self.high * other.low, self.high * other.high];
        Self::new(a.min(b).min(c.min(d)).next_down(), a.max(b).max(c.max(d)).next_up())
    }
}

impl Mul<f64> for Enclosure {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        let (a, b) = (self.low * factor, self.high * factor);
        Self::new(a.min(b).next_down(), a.max(b).next_up())
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn enclosures() -> impl Strategy<Value = (Enclosure, f64)> {
        (-3.0..3.0f64, 0.0..2.0f64, 0.0..=1.0f64).prop_map(|(low, width, share)| {
            let all = Enclosure::new(low, low + width);
            (all, (low + share * width).clamp(all.low, all.high))
        })
    }

    proptest! {
        /// A result from members lies in the result from the enclosures.
        #[test]
        fn operations_enclose((a, x) in enclosures(), (b, y) in enclosures(), factor in -2.0..2.0f64) {
            prop_assert!((a + b).contains(x + y));
            prop_assert!((a - b).contains(x - y));
            prop_assert!((a * b).contains(x * y));
            prop_assert!((a * factor).contains(x * factor));
            prop_assert!(a.square().contains(x * x));
            if x >= 0.0 {
                prop_assert!(a.square_root().is_some_and(|root| root.contains(x.sqrt())));
            }
            if a.low > 1e-3 {
                prop_assert!(a.reciprocal().is_some_and(|inverse| inverse.contains(1.0 / x)));
            }
            prop_assert!(a.hull(b).contains(x) && a.hull(b).contains(y));
            prop_assert!(a.halves().iter().any(|half| half.contains(x)));
            prop_assert_eq!(a.intersection(b).is_some_and(|both| both.contains(x)), b.contains(x));
        }
    }

    /// Exact results fall between doubles here: both neighbours must be within.
    #[test]
    fn results_that_no_double_holds_are_enclosed() {
        let tenth = Enclosure::point(0.1);
        let third = Enclosure::point(3.0).reciprocal().unwrap();
        assert!(third.low < 1.0 / 3.0 && third.high > 1.0 / 3.0);
        let hundredth = tenth * tenth;
        assert!(hundredth.low < 0.1 * 0.1 && hundredth.high > 0.1 * 0.1);
        let root = Enclosure::point(2.0).square_root().unwrap();
        assert!(root.low * root.low < 2.0 && root.high * root.high > 2.0);
    }

    #[test]
    fn what_has_no_real_value_gives_none() {
        assert_eq!(Enclosure::new(-2.0, -1.0).square_root(), None);
        assert_eq!(Enclosure::new(-1.0, 1.0).reciprocal(), None);
        assert_eq!(Enclosure::new(0.0, 1.0).intersection(Enclosure::new(2.0, 3.0)), None);
    }
}
