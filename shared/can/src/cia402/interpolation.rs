//! The interpolation time period, object 60C2: the duration of the move from one cyclic target to the next.

/// Longest value of 60C2:1.
const LONGEST: u64 = u8::MAX as u64;

/// A period in the form of object 60C2: value and power of ten, in seconds. The value has at most 255 steps, no finer than
/// 1 µs, and the fewest digits (1 · 10⁻³ rather than 100 · 10⁻⁵): some drives accept whole ms only.
///
/// A period between two values is rounded up: a drive that ends its move too early rests until the next SYNC.
pub const fn interpolation_period(period_ns: u64) -> (u8, i8) {
    let (mut unit_ns, mut exponent) = (1000, -6);
    while in_units(period_ns, unit_ns) > LONGEST && exponent < 0 {
        (unit_ns, exponent) = (unit_ns * 10, exponent + 1);
    }
    let mut value = in_units(period_ns, unit_ns);
    while value > 0 && value.is_multiple_of(10) && exponent < 0 {
        (value, exponent) = (value / 10, exponent + 1);
    }
    let value = if value > LONGEST { LONGEST } else { value };
    (if value == 0 { 1 } else { value as u8 }, exponent)
}

/// Rounded up once, from the period itself.
const fn in_units(period_ns: u64, unit_ns: u64) -> u64 {
    period_ns.div_ceil(unit_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_are_written_with_the_fewest_digits_and_never_too_short() {
        let table = [
            (1_000_000, (1, -3)),
            (2_500_000, (25, -4)),
            (4_000_000, (4, -3)),
            (100_000_000, (1, -1)),
            (1_000_000_000, (1, 0)),
            (125_000, (125, -6)),
            (3_333_333, (34, -4)),
            (2_544_529, (255, -5)),
            (1_124_859, (113, -5)),
            (2_550_001, (26, -4)),
            (0, (1, -6)),
            (1_000_000_000_000, (255, 0)),
        ];
        for (period_ns, expected) in table {
            assert_eq!(interpolation_period(period_ns), expected, "{period_ns} ns");
        }
    }
}
