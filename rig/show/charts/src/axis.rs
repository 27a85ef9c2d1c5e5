//! An axis: which values it covers, where a value lies on it, and which round values are labelled.

use std::ops::{Range, RangeInclusive};

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;

/// Least length of an axis, as a share of its greatest value: ticks must differ from each other.
const LEAST_SHARE: f64 = 1e-9;
/// Least length of an axis.
const LEAST: f64 = 1e-6;

/// How values are spaced along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    Linear,
    /// By their logarithm.
    Log,
}

impl Scale {
    pub(crate) fn position(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Log => value.log10(),
        }
    }

    fn value(self, position: f64) -> f64 {
        match self {
            Self::Linear => position,
            Self::Log => 10f64.powf(position),
        }
    }
}

/// A labelled axis.
#[derive(Debug, Clone)]
pub struct Axis {
    pub(crate) label: String,
    pub(crate) scale: Scale,
    pub(crate) included: Option<f64>,
    /// Its ends in positions of the scale; none until it is fitted to the data of a chart.
    ends: Option<[f64; 2]>,
    names: Vec<String>,
}

impl Axis {
    /// From one value to another.
    #[must_use]
    pub fn new(label: &str, scale: Scale, ends: [f64; 2]) -> Self {
        let mut axis = Self::fitted(label, scale);
        axis.fit(ends.map(|end| scale.position(end)));
        axis
    }

    /// Of the length that the data of a [`LineChart`](crate::LineChart) need.
    #[must_use]
    pub fn fitted(label: &str, scale: Scale) -> Self {
        Self { label: label.to_owned(), scale, included: None, ends: None, names: Vec::new() }
    }

    /// A place for each name instead of values: the first is at 0, the next at 1.
    #[must_use]
    pub fn of_names(label: &str, names: Vec<String>) -> Self {
        let end = names.len() as f64 - 0.5;
        Self { names, ..Self::new(label, Scale::Linear, [-0.5, end]) }
    }

    /// Fitted so that it covers this value, too.
    #[must_use]
    pub fn including(mut self, value: f64) -> Self {
        self.included = Some(value);
        self
    }

    /// Sets its ends, in positions of the scale, where it has none.
    pub(crate) fn fit(&mut self, [low, high]: [f64; 2]) {
        let least = LEAST.max(LEAST_SHARE * low.abs().max(high.abs()));
        self.ends.get_or_insert([low, high.max(low + least)]);
    }

    pub(crate) fn has_names(&self) -> bool {
        !self.names.is_empty()
    }

    fn ends(&self) -> [f64; 2] {
        self.ends.unwrap_or([0.0, 1.0])
    }

    fn ticks(&self) -> Vec<f64> {
        let [low, high] = self.ends();
        match self.scale {
            Scale::Linear if self.has_names() => (0..self.names.len()).map(|index| index as f64).collect(),
            Scale::Linear => linear_ticks(low, high),
            Scale::Log => log_ticks(low, high),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, pixels: (i32, i32)) -> i32 {
        let [low, high] = self.ends();
        RangedCoordf64::from(low..high).map(&self.scale.position(*value), pixels)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() {
            return Vec::new();
        }
        self.ticks().into_iter().map(|position| self.scale.value(position)).collect()
    }

    fn range(&self) -> Range<f64> {
        let [low, high] = self.ends().map(|end| self.scale.value(end));
        low..high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let position = self.scale.position(*value);
        match self.scale {
            Scale::Linear if self.has_names() => self.names.get(*value as usize).cloned().unwrap_or_default(),
            Scale::Linear => multiple_label(*value, tick_step(self.ends()[1] - self.ends()[0])),
            Scale::Log => power_label(nearly_whole(position), self.ends()),
        }
    }
}

/// A whole number that rounding has moved, as that number.
fn nearly_whole(value: f64) -> f64 {
    if (value - value.round()).abs() < 1e-9 { value.round() } else { value }
}

/// Most ticks of an axis, but for one at its end.
const MOST: f64 = 8.0;
/// Decades that are labelled with plain numbers, not as powers of ten.
const PLAIN_DECADES: RangeInclusive<i64> = -4..=4;

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
pub(crate) fn multiple_label(value: f64, step: f64) -> String {
    let decimals = -(step.log10() + 1e-9).floor();
    if !(-9.0..=9.0).contains(&decimals) {
        return plain_label(value);
    }
    let rounded = (value / step).round() * step;
    format!("{:.*}", decimals.max(0.0) as usize, if rounded == 0.0 { 0.0 } else { rounded })
}

/// Exponents of ten between two of them: whole ones where there are at least three, otherwise those of 1, 2 and 5 times
/// the powers of ten, or those of round values.
pub(crate) fn log_ticks(low: f64, high: f64) -> Vec<f64> {
    let whole = decades(low, high);
    if whole.len() >= 3 {
        return whole;
    }
    let between = |exponent: &f64| (low..=high).contains(exponent);
    let parts = (low.floor() as i64..=high as i64 + 1)
        .flat_map(|decade| [1.0_f64, 2.0, 5.0].map(|factor| decade as f64 + factor.log10()));
    let parts: Vec<_> = parts.filter(between).collect();
    if parts.len() >= 3 {
        return parts;
    }
    let values = linear_ticks(10f64.powf(low), 10f64.powf(high));
    values.into_iter().filter(|value| *value > 0.0).map(f64::log10).collect()
}

/// Whole exponents between two of them, every second, third … one where there are many.
fn decades(low: f64, high: f64) -> Vec<f64> {
    let [first, last] = [(low - 1e-9).ceil() as i64, (high + 1e-9).floor() as i64];
    let stride = ((last - first) as f64 / MOST).ceil().max(1.0) as i64;
    (first..=last).filter(|exponent| exponent % stride == 0).map(|exponent| exponent as f64).collect()
}

/// A number without trailing zeros and without the rounding errors of binary fractions.
pub(crate) fn plain_label(value: f64) -> String {
    if value != 0.0 && !(1e-9..1e9).contains(&value.abs()) {
        return format!("{value:e}");
    }
    let text = format!("{value:.9}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        shorter => shorter.to_owned(),
    }
}

/// An exponent of ten as a plain number, or as a power of ten where the axis reaches far.
pub(crate) fn power_label(exponent: f64, [low, high]: [f64; 2]) -> String {
    let is_plain = [low.ceil() as i64, high.floor() as i64].iter().all(|end| PLAIN_DECADES.contains(end));
    if is_plain || exponent.fract() != 0.0 {
        return plain_label(10f64.powf(exponent));
    }
    let raised = |digit: char| match digit.to_digit(10) {
        Some(digit) => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][digit as usize],
        None => '⁻',
    };
    format!("10{}", (exponent as i64).to_string().chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(low: f64, high: f64) -> Vec<String> {
        linear_ticks(low, high).into_iter().map(|tick| multiple_label(tick, tick_step(high - low))).collect()
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
    fn a_logarithmic_axis_is_labelled_at_round_values_however_short_it_is() {
        let labels = |low: f64, high: f64| {
            let [low, high] = [low.log10(), high.log10()];
            log_ticks(low, high).into_iter().map(|tick| power_label(tick, [low, high])).collect::<Vec<_>>()
        };
        assert_eq!(labels(0.01, 1000.0), ["0.01", "0.1", "1", "10", "100", "1000"]);
        assert_eq!(labels(30.0, 300.0), ["50", "100", "200"]);
        assert_eq!(labels(120.0, 160.0), ["120", "125", "130", "135", "140", "145", "150", "155", "160"]);
        assert_eq!(labels(1e-30, 1e2).first().unwrap(), "10⁻²⁸");
        assert_eq!(
            labels(1e-8, 1.0),
            ["10⁻⁸", "10⁻⁷", "10⁻⁶", "10⁻⁵", "10⁻⁴", "10⁻³", "10⁻²", "10⁻¹", "10⁰"]
        );
    }

    #[test]
    fn numbers_have_no_dust() {
        assert_eq!([0.1 * 3.0, -2.0, 0.0, 1e300].map(plain_label), ["0.3", "-2", "0", "1e300"]);
    }
}
