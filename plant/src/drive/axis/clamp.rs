//! Clamping of a value, with the information whether the value was changed.

/// The value clamped to `[low, high]`, and whether it was outside.
pub(super) fn clamp(asked: f64, [low, high]: [f64; 2]) -> (f64, bool) {
    let kept = asked.max(low).min(high);
    (kept, kept.to_bits() != asked.to_bits())
}

/// The value clamped to ± `limit`, and whether it was outside.
pub(super) fn clamp_symmetric(asked: f64, limit: f64) -> (f64, bool) {
    clamp(asked, [-limit, limit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_outside_becomes_the_nearer_limit_and_is_reported() {
        let table = [(3.0, (2.0, true)), (2.0, (2.0, false)), (-0.0, (-0.0, false)), (-5.0, (-1.0, true))];
        for (asked, kept) in table {
            assert_eq!(clamp(asked, [-1.0, 2.0]), kept);
        }
        assert_eq!(clamp_symmetric(-3.0, 2.0), (-2.0, true));
    }
}
