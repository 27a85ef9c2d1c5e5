//! An axis: which values it covers, where a value lies on it, and which values are labelled.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;

use crate::ticks;

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
            Scale::Linear => ticks::linear(low, high),
            Scale::Log => ticks::logarithmic(low, high),
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
            Scale::Linear => ticks::multiple(*value, ticks::step(self.ends()[1] - self.ends()[0])),
            Scale::Log => ticks::power(nearly_whole(position), self.ends()),
        }
    }
}

/// A whole number that rounding has moved, as that number.
fn nearly_whole(value: f64) -> f64 {
    if (value - value.round()).abs() < 1e-9 { value.round() } else { value }
}
