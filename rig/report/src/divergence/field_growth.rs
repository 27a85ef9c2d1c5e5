//! How the difference of one field grows.

use masseter_recording::{Field, Number};
use serde::Serialize;

use super::measure::Measure;

/// What is small, in the unit of the difference: 1 µm, 1 mrad, 1 N, …
const SMALL: f64 = 1.0;

/// The differences of one field.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct FieldGrowth {
    pub(super) field: String,
    /// The unit of all sizes; empty where the field has none.
    unit: &'static str,
    pub(super) first_cycle: u64,
    /// The first element that differs there; none where the field is a single number.
    pub(super) element: Option<usize>,
    /// Its values.
    pub(super) values: [String; 2],
    /// The size of the first difference of the whole field.
    pub(super) first: Option<f64>,
    /// The first cycle with a difference beyond one of the unit.
    pub(super) beyond_one_cycle: Option<u64>,
    pub(super) largest: Option<f64>,
    pub(super) largest_cycle: u64,
    /// Messages that differ in it.
    messages: u64,
    /// The last cycle that differs, and the size there.
    #[serde(skip)]
    last: (u64, Option<f64>),
    pub(super) at_end: Option<f64>,
}

impl FieldGrowth {
    pub(super) fn new(field: &Field, cycle: u64, [a, b]: [&[u8]; 2]) -> Self {
        let bits = |number: &Number| (number.to_string(), number.to_f64().to_bits());
        let differing = field.numbers(a).zip(field.numbers(b)).enumerate();
        let first = differing.map(|(place, (a, b))| (place, [a, b])).find(|(_, [a, b])| bits(a) != bits(b));
        let (place, values) = first.expect("the field differs");
        Self::of(field.name(), Self::measure(field, a).unit(), cycle, values.map(|value| value.to_string()))
            .with_element(field.is_array().then_some(place))
    }

    /// The first difference of a field without numbers.
    pub(super) fn of(field: &str, unit: &'static str, cycle: u64, values: [String; 2]) -> Self {
        Self {
            field: field.to_owned(),
            unit,
            first_cycle: cycle,
            element: None,
            values,
            first: None,
            beyond_one_cycle: None,
            largest: None,
            largest_cycle: cycle,
            messages: 0,
            last: (cycle, None),
            at_end: None,
        }
    }

    fn with_element(self, element: Option<usize>) -> Self {
        Self { element, ..self }
    }

    fn measure(field: &Field, body: &[u8]) -> Measure {
        Measure::of(field, field.numbers(body).count())
    }

    /// The size of the difference of a field.
    pub(super) fn size(field: &Field, [a, b]: [&[u8]; 2]) -> Option<f64> {
        let numbers = |body| field.numbers(body).map(Number::to_f64).collect::<Vec<_>>();
        Self::measure(field, a).size(&numbers(a), &numbers(b))
    }

    /// Takes the difference of a cycle.
    pub(super) fn take(&mut self, cycle: u64, size: Option<f64>) {
        if self.messages == 0 {
            self.first = size;
        }
        self.messages += 1;
        self.last = (cycle, size);
        let Some(size) = size else { return };
        if !self.unit.is_empty() && size > SMALL {
            self.beyond_one_cycle.get_or_insert(cycle);
        }
        if self.largest.is_none_or(|largest| size > largest) {
            (self.largest, self.largest_cycle) = (Some(size), cycle);
        }
    }

    /// Ends a comparison whose last message of the topic was of this cycle.
    pub(super) fn finish(mut self, last_cycle: u64) -> Self {
        let (cycle, size) = self.last;
        self.at_end = if cycle == last_cycle { size } else { self.largest.map(|_| 0.0) };
        self
    }

    /// The field with its element: `target_m[3]`.
    pub(super) fn name(&self) -> String {
        self.element.map_or_else(|| self.field.clone(), |element| format!("{}[{element}]", self.field))
    }

    /// A size with its unit.
    pub(super) fn sized(&self, size: Option<f64>) -> String {
        let number = |size: f64| match size.abs() {
            0.0 => "0".to_owned(),
            1e-3..1e5 => format!("{size:.3}"),
            _ => format!("{size:.2e}"),
        };
        size.map_or_else(
            || "–".to_owned(),
            |size| format!("{} {}", number(size), self.unit).trim_end().to_owned(),
        )
    }
}
