//! A polynomial of degree 8 on [0, 1] in Bernstein form, and where its zeros can be.
//!
//! A polynomial lies within the hull of its Bernstein coefficients, and has as many zeros as they
//! change sign, or fewer by an even number. So coefficients of one sign prove that there is no zero,
//! one change proves exactly one, and halving the interval decides the rest, but for places where the
//! polynomial is smaller than its own rounding error. Those are reported, never dropped.

use super::four_bar::Interval;

/// The elimination's degree in cos θ₁.
pub(super) const DEGREE: usize = 8;
/// Chebyshev points (1 − cos kπ/8)/2 in van der Corput's order, in which divided differences grow
/// least.
pub(super) const NODES: [f64; DEGREE + 1] = [
    0.0,
    1.0,
    0.5,
    0.146_446_609_406_726_24,
    0.853_553_390_593_273_7,
    0.038_060_233_744_356_62,
    0.961_939_766_255_643_4,
    0.308_658_283_817_455_14,
    0.691_341_716_182_544_9,
];
/// Error of the coefficients relative to the largest value at a node; measured below as 2·10⁻¹³ with
/// values that carry 16 roundings.
const NOISE: f64 = 2e-12;
/// Halvings after which what is undecided is reported as it is.
const DEEPEST: u32 = 13;
/// Intervals looked at before giving up; the neutral input, with its two triple zeros, takes 60.
const MOST_INTERVALS: u32 = 1000;

/// Where zeros are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Zeros {
    /// Exactly one, with a change of sign.
    One(Interval),
    /// Any number, also none: the polynomial is zero here but for rounding.
    Undecided(Interval),
}

/// More intervals than allowed, or values that are no numbers: the polynomial vanishes on a whole
/// stretch but for rounding, or is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Vanishing;

/// Coefficients on an interval that came from [0, 1] by halving.
#[derive(Debug, Clone, Copy)]
struct Piece {
    coefficients: [f64; DEGREE + 1],
    interval: Interval,
    depth: u32,
}

/// What the signs of the coefficients prove.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Verdict {
    NoZero,
    OneZero,
    Unknown,
}

/// Calls `found` for every place in [0, 1] where the polynomial through these values at [`NODES`] has
/// zeros.
pub(super) fn locate(values: &[f64; DEGREE + 1], mut found: impl FnMut(Zeros)) -> Result<(), Vanishing> {
    if !values.iter().all(|value| value.is_finite()) {
        return Err(Vanishing);
    }
    let noise = NOISE * values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
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
            Verdict::NoZero => {}
            Verdict::OneZero => found(Zeros::One(piece.interval)),
            Verdict::Unknown if piece.depth == DEEPEST => {
                undecided = Some(joined(undecided, piece.interval, &mut found));
            }
            Verdict::Unknown => {
                let [low, high] = piece.halved();
                (pending[waiting], pending[waiting + 1]) = (high, low);
                waiting += 2;
            }
        }
    }
    Err(Vanishing)
}

/// Adjacent undecided intervals are one; an earlier one that is not adjacent is reported.
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
    fn verdict(&self, noise: f64) -> Verdict {
        let [first, .., last] = self.coefficients;
        if first.abs() <= noise || last.abs() <= noise {
            return Verdict::Unknown;
        }
        let (mut positive, mut changes, mut doubtful) = (first > 0.0, 0, 0);
        for coefficient in self.coefficients {
            if coefficient.abs() <= noise {
                doubtful += 1;
                continue;
            }
            let changed = (coefficient > 0.0) != positive;
            // One doubtful value between two signs adds no change, more of them or equal signs may.
            if doubtful > usize::from(changed) {
                return Verdict::Unknown;
            }
            (changes, doubtful) = (changes + usize::from(changed), 0);
            positive = coefficient > 0.0;
        }
        match changes {
            0 => Verdict::NoZero,
            1 => Verdict::OneZero,
            _ => Verdict::Unknown,
        }
    }

    /// De Casteljau's algorithm at the middle: averages only, so that no error grows.
    fn halved(&self) -> [Self; 2] {
        let middle = self.interval.at(0.5);
        let (mut low, mut high) = (*self, *self);
        low.interval.high = middle;
        high.interval.low = middle;
        (low.depth, high.depth) = (self.depth + 1, self.depth + 1);
        for level in 1..=DEGREE {
            for index in 0..=DEGREE - level {
                high.coefficients[index] = 0.5 * (high.coefficients[index] + high.coefficients[index + 1]);
            }
            low.coefficients[level] = high.coefficients[0];
        }
        [low, high]
    }
}

/// Bernstein coefficients of the polynomial through the values: Newton's divided differences, then
/// Horner's rule in Bernstein form.
fn interpolate(values: &[f64; DEGREE + 1]) -> [f64; DEGREE + 1] {
    let mut differences = *values;
    for order in 1..=DEGREE {
        for index in (order..=DEGREE).rev() {
            let span = NODES[index] - NODES[index - order];
            differences[index] = (differences[index] - differences[index - 1]) / span;
        }
    }
    let mut coefficients = [0.0; DEGREE + 1];
    coefficients[0] = differences[DEGREE];
    for degree in 1..=DEGREE {
        let node = NODES[DEGREE - degree];
        for index in (0..=degree).rev() {
            let kept = if index < degree { coefficients[index] } else { 0.0 };
            let raised = if index > 0 { coefficients[index - 1] } else { 0.0 };
            let share = index as f64 / degree as f64;
            let product = share * (1.0 - node) * raised - (1.0 - share) * node * kept;
            coefficients[index] = product + differences[DEGREE - degree];
        }
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
        locate(values, |zeros| all.push(zeros)).unwrap();
        all
    }

    #[test]
    fn the_nodes_are_chebyshevs() {
        for (node, k) in NODES.iter().zip([0, 8, 4, 2, 6, 1, 7, 3, 5]) {
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
        assert_eq!(locate(&[0.0; DEGREE + 1], |_| ()), Err(Vanishing));
        assert_eq!(locate(&[f64::NAN; DEGREE + 1], |_| ()), Err(Vanishing));
    }

    proptest! {
        /// Every zero is in a reported interval, and an interval with one zero has one.
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
