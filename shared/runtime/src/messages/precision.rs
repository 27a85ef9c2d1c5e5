//! The precision of computed figures in messages: 31 significant bits, nine decimal digits.
//!
//! A place of 0.3 m keeps steps of 0.2 nm, far below every encoder. Lower bits are rounding errors of formulas. They do not
//! compress, and would be a sixth of a recording (docs/data.md). Commands, readings, times, and the signals of a controller
//! keep every bit.

/// Lowest bits of the significand that are set to zero.
pub(super) const ZERO_BITS: u32 = 22;

/// Rounds to the nearest number with the published precision, away from zero where two are as near. What is no finite number
/// stays.
pub(super) fn round<'a>(values: impl IntoIterator<Item = &'a mut f64>) {
    const HALF: u64 = 1 << (ZERO_BITS - 1);
    for value in values.into_iter().filter(|value| value.is_finite()) {
        // A carry into the exponent is the next power of two, which is right.
        let rounded = f64::from_bits((value.to_bits() + HALF) & (u64::MAX << ZERO_BITS));
        if rounded.is_finite() {
            *value = rounded;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn rounded(value: f64) -> f64 {
        let mut values = [value];
        round(&mut values);
        values[0]
    }

    proptest! {
        #[test]
        fn the_nearest_number_of_nine_digits(value in prop::num::f64::NORMAL) {
            let rounded = rounded(value);
            prop_assume!(value.abs() < f64::MAX / 2.0);
            prop_assert_eq!(rounded.to_bits() % (1 << ZERO_BITS), 0);
            prop_assert!((rounded - value).abs() <= value.abs() * 2.0_f64.powi(-31));
        }
    }

    #[test]
    fn what_is_exact_or_no_number_stays() {
        for value in [0.0, -0.0, 1.0, -0.25, 1e9, f64::MAX, f64::MIN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(rounded(value).to_bits(), value.to_bits());
        }
        for nan in [u64::MAX, i64::MAX as u64, f64::NAN.to_bits(), f64::INFINITY.to_bits() + 1] {
            assert_eq!(rounded(f64::from_bits(nan)).to_bits(), nan);
        }
        assert_eq!(rounded(2.0 - f64::EPSILON).to_bits(), 2.0_f64.to_bits(), "a carry into the exponent");
    }
}
