//! A polynomial of degree 8 on [0, 1] in Bernstein form, and the places of its zeros.
//!
//! A polynomial lies within the hull of its Bernstein coefficients. The number of its zeros is the number of sign
//! changes of the coefficients, or less by an even number. So coefficients of one sign prove no zero, and one sign
//! change proves exactly one zero. Halving the interval decides the rest, except where the polynomial is smaller than
//! its own rounding error. The module reports such places.

/// The elimination's degree in cos θ₁.
pub(super) const DEGREE: usize = 8;
/// Chebyshev points (1 − cos kπ/8)/2, between which interpolation grows errors least.
pub(super) const NODES: [f64; DEGREE + 1] = [
    0.0,
    0.038_060_233_744_356_62,
    0.146_446_609_406_726_24,
    0.308_658_283_817_455_14,
    0.5,
    0.691_341_716_182_544_9,
    0.853_553_390_593_273_7,
    0.961_939_766_255_643_4,
    1.0,
];
/// Error of the coefficients relative to the largest value at a node. A test below measures 2·10⁻¹³ for the
/// interpolation of values with 16 roundings relative to each. The rest is for cancellation within the values.
const NOISE: f64 = 2e-12;
/// Error of the coefficients relative to the caller's largest rounding of a value.
const GROWTH: f64 = 20.0;
/// The first and the last coefficient, one bit each.
const ENDS: u32 = 1 | 1 << DEGREE;
/// Halvings before an undecided interval is reported.
const DEEPEST: u32 = 13;
/// Most intervals of a search; the neutral input, with its two triple zeros, takes 60.
const MOST_INTERVALS: u32 = 1000;

/// A closed interval; empty when its ends are not in order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub low: f64,
    pub high: f64,
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

/// Places of zeros.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Zeros {
    /// Exactly one, with a change of sign.
    One(Interval),
    /// Any number, also none: except for rounding, the polynomial is zero here.
    Undecided(Interval),
}

/// More intervals than allowed, or values that are no numbers. Except for rounding, the polynomial vanishes on a whole
/// stretch, or is no polynomial.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Vanishing;

/// Coefficients on an interval from the halving of [0, 1].
#[derive(Debug, Clone, Copy)]
struct Piece {
    coefficients: [f64; DEGREE + 1],
    interval: Interval,
    depth: u32,
}

/// The proof by the signs of the coefficients.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum SignTest {
    NoZero,
    OneZero,
    Unknown,
}

/// Calls `found` for every place in [0, 1] where the polynomial through these values at [`NODES`] has zeros.
/// `rounding` is the largest error of a value.
pub(super) fn locate(
    values: &[f64; DEGREE + 1],
    rounding: f64,
    mut found: impl FnMut(Zeros),
) -> Result<(), Vanishing> {
    if !values.iter().all(|value| value.is_finite()) {
        return Err(Vanishing);
    }
    let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let noise = (NOISE * largest).max(GROWTH * rounding);
    let mut pending = [Piece::whole(values); DEEPEST as usize + 1];
    let mut waiting = 1;
    let mut undecided: Option<Interval> = None;
    for _ in 0..MOST_INTERVALS {
        if waiting == 0 {
            if let Some(interval) = undecided {
                found(Zeros::Undecided(interval));
            }
            return Ok(());
        }
        waiting -= 1;
        let piece = pending[waiting];
        match piece.verdict(noise) {
            SignTest::NoZero => {}
            SignTest::OneZero => found(Zeros::One(piece.interval)),
            SignTest::Unknown if piece.depth == DEEPEST => {
                undecided = Some(joined(undecided, piece.interval, &mut found));
            }
            SignTest::Unknown => {
                let [low, high] = piece.halved();
                (pending[waiting], pending[waiting + 1]) = (high, low);
                waiting += 2;
            }
        }
    }
    Err(Vanishing)
}

/// Joins adjacent undecided intervals; reports an earlier interval that is not adjacent.
fn joined(earlier: Option<Interval>, next: Interval, found: &mut impl FnMut(Zeros)) -> Interval {
    match earlier {
        Some(earlier) if earlier.high >= next.low => Interval { low: earlier.low, high: next.high },
        Some(earlier) => {
            found(Zeros::Undecided(earlier));
            next
        }
        None => next,
    }
}

impl Piece {
    fn whole(values: &[f64; DEGREE + 1]) -> Self {
        Self { coefficients: interpolate(values), interval: Interval { low: 0.0, high: 1.0 }, depth: 0 }
    }

    /// Coefficients within the noise count as either sign.
    fn verdict(&self, noise: f64) -> SignTest {
        let (mut positive, mut negative) = (0u32, 0u32);
        for (index, &coefficient) in self.coefficients.iter().enumerate() {
            positive |= u32::from(coefficient > noise) << index;
            negative |= u32::from(coefficient < -noise) << index;
        }
        let clear = positive | negative;
        if clear & ENDS != ENDS {
            return SignTest::Unknown;
        }
        // Each doubtful coefficient takes the sign of the one before.
        let mut doubtful = !clear & ((1 << (DEGREE + 1)) - 1);
        while doubtful != 0 {
            let index = doubtful.trailing_zeros();
            let before = positive >> (index - 1) & 1;
            // One doubtful value between two different signs adds no sign change; more such values, or equal signs, may
            // add some.
            if clear >> (index + 1) & 1 == 0 || positive >> (index + 1) & 1 == before {
                return SignTest::Unknown;
            }
            positive |= before << index;
            doubtful &= doubtful - 1;
        }
        match ((positive ^ positive >> 1) & ((1 << DEGREE) - 1)).count_ones() {
            0 => SignTest::NoZero,
            1 => SignTest::OneZero,
            _ => SignTest::Unknown,
        }
    }

    /// De Casteljau's algorithm at the middle uses averages only, so that no error grows.
    fn halved(&self) -> [Self; 2] {
        let mut row = self.coefficients;
        let (mut low, mut high) = (row, row);
        for level in 1..=DEGREE {
            // Entries beyond DEGREE − level are not used; loops of one length are unrolled and faster.
            for index in 0..DEGREE {
                row[index] = 0.5 * (row[index] + row[index + 1]);
            }
            (low[level], high[DEGREE - level]) = (row[0], row[DEGREE - level]);
        }
        let (Interval { low: start, high: end }, middle) = (self.interval, self.interval.at(0.5));
        let half = |coefficients, low, high| Self {
            coefficients,
            interval: Interval { low, high },
            depth: self.depth + 1,
        };
        [half(low, start, middle), half(high, middle, end)]
    }
}

/// Bernstein coefficients of the polynomial through the values.
fn interpolate(values: &[f64; DEGREE + 1]) -> [f64; DEGREE + 1] {
    let mut coefficients = [0.0; DEGREE + 1];
    for (value, cardinal) in values.iter().zip(&CARDINALS) {
        for (coefficient, share) in coefficients.iter_mut().zip(cardinal) {
            *coefficient += value * share;
        }
    }
    coefficients
}

/// Bernstein coefficients of the polynomials that are 1 at one node and 0 at all others.
const CARDINALS: [[f64; DEGREE + 1]; DEGREE + 1] = {
    let mut all = [[0.0; DEGREE + 1]; DEGREE + 1];
    let mut node = 0;
    while node <= DEGREE {
        all[node] = cardinal(node);
        node += 1;
    }
    all
};

/// One factor (x − other) / (node − other) after the other. Each raises the degree by one.
const fn cardinal(node: usize) -> [f64; DEGREE + 1] {
    let mut coefficients = [0.0; DEGREE + 1];
    coefficients[0] = 1.0;
    let (mut degree, mut other) = (0, 0);
    while other <= DEGREE {
        if other != node {
            degree += 1;
            let span = NODES[node] - NODES[other];
            let (at_low, at_high) = (-NODES[other] / span, (1.0 - NODES[other]) / span);
            let mut index = degree;
            loop {
                let share = index as f64 / degree as f64;
                let kept = if index < degree { coefficients[index] } else { 0.0 };
                let raised = if index > 0 { coefficients[index - 1] } else { 0.0 };
                coefficients[index] = share * at_high * raised + (1.0 - share) * at_low * kept;
                if index == 0 {
                    break;
                }
                index -= 1;
            }
        }
        other += 1;
    }
    coefficients
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn sampled(zeros: &[f64]) -> [f64; DEGREE + 1] {
        NODES.map(|node| zeros.iter().map(|zero| node - zero).product())
    }

    fn located(values: &[f64; DEGREE + 1]) -> Vec<Zeros> {
        let mut all = Vec::new();
        locate(values, 0.0, |zeros| all.push(zeros)).unwrap();
        all
    }

    #[test]
    fn the_nodes_are_chebyshevs() {
        for (node, k) in NODES.iter().zip(0..) {
            let expected = (1.0 - (f64::from(k) * std::f64::consts::PI / 8.0).cos()) / 2.0;
            assert!((node - expected).abs() < 2e-16);
        }
    }

    #[test]
    fn a_triple_zero_is_reported_as_undecided_and_a_polynomial_that_vanishes_as_such() {
        let zeros = located(&sampled(&[0.3, 0.3, 0.3, 0.7, -1.0, 2.0]));
        let [Zeros::One(single), Zeros::Undecided(triple)] = zeros[..] else { panic!("{zeros:?}") };
        assert!(triple.low <= 0.3 && 0.3 <= triple.high && triple.width() < 2e-3);
        assert!(single.low <= 0.7 && 0.7 <= single.high);
        assert_eq!(locate(&[0.0; DEGREE + 1], 0.0, |_| ()), Err(Vanishing));
        assert_eq!(locate(&[f64::NAN; DEGREE + 1], 0.0, |_| ()), Err(Vanishing));
    }

    proptest! {
        /// Every zero is in a reported interval, and an interval reported with one zero has exactly one.
        #[test]
        fn no_zero_is_lost(
            zeros in prop::collection::vec(-0.3..1.3f64, DEGREE),
            noise in prop::array::uniform9(-8.0..8.0f64),
        ) {
            let mut values = sampled(&zeros);
            for (value, roundings) in values.iter_mut().zip(noise) {
                *value *= 1.0 + roundings * f64::EPSILON;
            }
            let places = located(&values);
            for &zero in zeros.iter().filter(|zero| (0.0..=1.0).contains(*zero)) {
                let holds = |interval: &Interval| interval.low <= zero && zero <= interval.high;
                prop_assert!(places.iter().any(|place| match place {
                    Zeros::One(interval) | Zeros::Undecided(interval) => holds(interval),
                }), "{zero} in {places:?}");
            }
            for place in places {
                if let Zeros::One(interval) = place {
                    let count = zeros.iter().filter(|&&z| interval.low <= z && z <= interval.high).count();
                    prop_assert_eq!(count, 1);
                }
            }
        }

        #[test]
        fn interpolation_is_exact_within_the_declared_noise(zeros in prop::collection::vec(-0.3..1.3f64, DEGREE)) {
            let values = sampled(&zeros);
            let most = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
            let mut at_zero = interpolate(&values);
            // De Casteljau at each of the polynomial's zeros.
            for zero in zeros.into_iter().filter(|zero| (0.0..=1.0).contains(zero)) {
                at_zero = interpolate(&values);
                for level in 1..=DEGREE {
                    for index in 0..=DEGREE - level {
                        at_zero[index] = (1.0 - zero) * at_zero[index] + zero * at_zero[index + 1];
                    }
                }
                prop_assert!(at_zero[0].abs() <= 2e-13 * most, "{:e}", at_zero[0] / most);
            }
            prop_assert!(at_zero.iter().all(|value| value.is_finite()));
        }
    }
}
