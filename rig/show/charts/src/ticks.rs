//! Round values along an axis, and their labels.

/// Most ticks of an axis, but for one at its end.
const MOST: f64 = 8.0;

/// Multiples of 1, 2 or 5 times a power of ten between two values.
pub(crate) fn linear_ticks(low: f64, high: f64) -> Vec<f64> {
    let step = tick_step(high - low);
    if !(step > 0.0 && step.is_finite()) {
        return Vec::new();
    }
    let [first, last] = [(low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64];
    (first..=last).map(|multiple| multiple as f64 * step).collect()
}

/// The distance of ticks over so long a range.
pub(crate) fn tick_step(range: f64) -> f64 {
    let least = range / MOST;
    let power = 10f64.powf(least.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= least * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

/// A multiple of a step, with as many decimals as the step needs.
pub(crate) fn label_of_step(value: f64, step: f64) -> String {
    let decimals = -(step.log10() + 1e-9).floor();
    if !(-9.0..=9.0).contains(&decimals) {
        return plain_label(value);
    }
    let rounded = (value / step).round() * step;
    format!("{:.*}", decimals.max(0.0) as usize, if rounded == 0.0 { 0.0 } else { rounded })
}

/// A number without trailing zeros and without the rounding errors of binary fractions.
fn plain_label(value: f64) -> String {
    if value != 0.0 && !(1e-5..1e9).contains(&value.abs()) {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.9}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        shorter => shorter.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        linear_ticks(low, high).into_iter().map(|tick| label_of_step(tick, tick_step(high - low))).collect()
    }

    #[test]
    fn ticks_are_round_few_and_their_labels_differ() {
        assert_eq!(labels(-0.1, 1.05), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(-40.0, 81.0), ["-40", "-20", "0", "20", "40", "60", "80"]);
        assert_eq!(labels(2.0, 2.0301), ["2.000", "2.005", "2.010", "2.015", "2.020", "2.025", "2.030"]);
        for (low, high) in [(2.0, 2.04), (0.0, 0.9), (1.0, 3.5), (-7.0, 20.0), (5.0, 800.0), (1e6, 1e6 + 1.0)]
        {
            let mut ticks = labels(low, high);
            assert!((3..=9).contains(&ticks.len()), "{ticks:?}");
            ticks.dedup();
            assert_eq!(ticks.len(), linear_ticks(low, high).len(), "{ticks:?}");
        }
        assert!(linear_ticks(1.0, 1.0).is_empty() && linear_ticks(0.0, f64::INFINITY).is_empty());
    }

    #[test]
    fn numbers_have_no_dust() {
        assert_eq!([0.1 * 3.0, -2.0, 0.0, 1e300].map(plain_label), ["0.3", "-2", "0", "1e300"]);
    }
}
