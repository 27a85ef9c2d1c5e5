//! A value within its limits, and whether that took anything away.

/// The value within `[low, high]`, and whether it was outside.
pub(super) fn clamped(asked: f64, [low, high]: [f64; 2]) -> (f64, bool) {
    let kept = asked.max(low).min(high);
    (kept, kept.to_bits() != asked.to_bits())
}

/// The same within ± `limit`.
pub(super) fn clamped_both_ways(asked: f64, limit: f64) -> (f64, bool) {
    clamped(asked, [-limit, limit])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_outside_comes_to_the_nearer_limit_and_is_told() {
        let table = [(3.0, (2.0, true)), (2.0, (2.0, false)), (-0.0, (-0.0, false)), (-5.0, (-1.0, true))];
        for (asked, kept) in table {
            assert_eq!(clamped(asked, [-1.0, 2.0]), kept);
        }
        assert_eq!(clamped_both_ways(-3.0, 2.0), (-2.0, true));
    }
}
