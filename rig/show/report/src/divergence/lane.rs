//! The messages of one publisher on one topic side by side, and how the difference of each field grows.

use std::collections::{BTreeMap, VecDeque};
use std::{array, cmp::Ordering};

use masseter_recording::{Columns, Field, Number, Recorded, Topic};
use serde::Serialize;

use crate::text::or_dash;

/// Topics in the order of a cycle, so that a cause comes before its effects.
const ORDER: [Topic; Topic::ALL.len()] = [
    Topic::Truth,
    Topic::Contact,
    Topic::Reading,
    Topic::Command,
    Topic::State,
    Topic::Signals,
    Topic::Parameters,
    Topic::Event,
    Topic::Frame,
    Topic::Machine,
];

/// What distinguishes a lane from others. Both processes publish events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct LaneKey {
    place: usize,
    is_of_controller: bool,
}

impl LaneKey {
    pub(super) fn of(message: &Recorded) -> Self {
        let place =
            ORDER.iter().position(|topic| *topic == message.topic()).expect("every topic has a place");
        let is_of_controller = matches!(message, Recorded::Event(event) if event.is_of_controller());
        Self { place, is_of_controller }
    }

    pub(super) fn topic(self) -> Topic {
        ORDER[self.place]
    }
}

/// Messages that one side alone has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub(super) struct Missing {
    pub(super) topic: &'static str,
    /// Whether the second side has them.
    pub(super) only_in_b: bool,
    pub(super) first_cycle: u64,
    pub(super) messages: u64,
}

/// The messages of a lane that have not been compared yet, and what the others had in common.
#[derive(Debug, Default)]
pub(super) struct Lane {
    /// Each with its cycle.
    waiting: [VecDeque<(u64, Recorded)>; 2],
    /// By the place of the field in the message.
    growths: BTreeMap<usize, FieldGrowth>,
    /// What only one side has.
    missing: [Option<Missing>; 2],
    last_cycle: u64,
    pub(super) messages: u64,
}

impl Lane {
    pub(super) fn push(&mut self, side: usize, cycle: u64, message: &Recorded) {
        self.waiting[side].push_back((cycle, *message));
    }

    /// Compares what has a partner, in all fields of `columns` that `is_compared`.
    pub(super) fn compare_partners(&mut self, columns: Option<&Columns>, is_compared: impl Fn(&str) -> bool) {
        while let [Some((cycle_a, a)), Some((cycle_b, b))] = self.waiting.each_ref().map(VecDeque::front) {
            // Events and frames have partners by their order: a cycle has any number of them.
            let is_by_order = matches!(a.topic(), Topic::Event | Topic::Frame | Topic::Machine);
            match if is_by_order { Ordering::Equal } else { cycle_a.cmp(cycle_b) } {
                Ordering::Less => self.drop_front(0),
                Ordering::Greater => self.drop_front(1),
                Ordering::Equal => {
                    let (cycle, bodies) = (*cycle_a, [*a, *b]);
                    self.waiting.iter_mut().for_each(|waiting| _ = waiting.pop_front());
                    self.messages += 1;
                    self.last_cycle = cycle;
                    if let Some(columns) = columns
                        && bodies[0].body() != bodies[1].body()
                    {
                        self.compare(columns, cycle, bodies.each_ref(), &is_compared);
                    }
                }
            }
        }
    }

    fn compare(
        &mut self,
        columns: &Columns,
        cycle: u64,
        messages: [&Recorded; 2],
        is_compared: impl Fn(&str) -> bool,
    ) {
        let (topic, bodies) = (messages[0].topic().name(), messages.map(Recorded::body));
        for (place, field) in columns.fields().iter().enumerate() {
            let [a, b] = bodies.map(|body| field.bytes(body));
            if a != b && is_compared(field.name()) {
                let numbers = bodies.map(|body| field.numbers(body).collect::<Vec<_>>());
                let (unit, size) = difference(field, &numbers);
                let growth = self.growths.entry(place);
                growth
                    .or_insert_with(|| FieldGrowth {
                        topic,
                        ..FieldGrowth::new(field, unit, cycle, &numbers)
                    })
                    .add_difference(cycle, size);
            }
        }
        let tails = bodies.map(|body| columns.split(body).map_or(body, |(_, tail)| tail));
        if let Some(tail) = columns.tail()
            && tails[0] != tails[1]
        {
            let values = tails.map(|tail| data_encoding::HEXUPPER.encode(tail));
            let growth = self.growths.entry(columns.fields().len());
            growth
                .or_insert_with(|| FieldGrowth { topic, ..FieldGrowth::of(tail.name(), "", cycle, values) })
                .add_difference(cycle, None);
        }
    }

    fn drop_front(&mut self, side: usize) {
        if let Some((first_cycle, message)) = self.waiting[side].pop_front() {
            let (topic, only_in_b) = (message.topic().name(), side == 1);
            let none = Missing { topic, only_in_b, first_cycle, messages: 0 };
            self.missing[side].get_or_insert(none).messages += 1;
        }
    }

    /// Ends the comparison: what still waits has no partner. Returns the differing fields, and what only one side has.
    pub(super) fn into_differences(mut self) -> (Vec<FieldGrowth>, [Option<Missing>; 2]) {
        for side in 0..2 {
            while !self.waiting[side].is_empty() {
                self.drop_front(side);
            }
        }
        let last_cycle = self.last_cycle;
        let growths = self.growths.into_values().map(|growth| growth.ended(last_cycle));
        (growths.collect(), array::from_fn(|side| self.missing[side]))
    }
}

/// What is small, in the unit of the difference: 1 µm, 1 mrad, 1 N, …
const SMALL: f64 = 1.0;

/// The differences of one field.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub(super) struct FieldGrowth {
    pub(super) topic: &'static str,
    /// The time of the first difference since the motion began, s.
    pub(super) motion_s: Option<f64>,
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
    fn new(field: &Field, unit: &'static str, cycle: u64, [a, b]: &[Vec<Number>; 2]) -> Self {
        let bits = |number: &Number| (number.to_string(), number.to_f64().to_bits());
        let mut differing = a.iter().zip(b).enumerate().filter(|(_, (a, b))| bits(a) != bits(b));
        let (place, (a, b)) = differing.next().expect("the field differs");
        let element = field.is_array().then_some(place);
        Self { element, ..Self::of(field.name(), unit, cycle, [a.to_string(), b.to_string()]) }
    }

    /// The first difference of a field without numbers.
    fn of(field: &str, unit: &'static str, cycle: u64, values: [String; 2]) -> Self {
        let (field, last) = (field.to_owned(), (cycle, None));
        Self { field, unit, first_cycle: cycle, values, largest_cycle: cycle, last, ..Self::default() }
    }

    /// Takes the difference of a cycle.
    fn add_difference(&mut self, cycle: u64, size: Option<f64>) {
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
    fn ended(mut self, last_cycle: u64) -> Self {
        let (cycle, size) = self.last;
        self.at_end = if cycle == last_cycle { size } else { self.largest.map(|_| 0.0) };
        self
    }

    /// The field with its topic and element: `command.target_m[3]`.
    pub(super) fn name(&self) -> String {
        let element = self.element.map_or_else(String::new, |element| format!("[{element}]"));
        format!("{}.{}{element}", self.topic, self.field)
    }

    /// A size with its unit.
    pub(super) fn sized(&self, size: Option<f64>) -> String {
        let number = |size: f64| match size.abs() {
            0.0 => "0".to_owned(),
            1e-3..1e5 => format!("{size:.3}"),
            _ => format!("{size:.2e}"),
        };
        or_dash(size, |size| format!("{} {}", number(size), self.unit).trim_end().to_owned())
    }
}

/// What the name of a field ends with, the unit for its differences, and how many of these make one of the field's unit.
/// The longest ends come first.
const UNITS: [(&str, &str, f64); 7] = [
    ("_per_s", "1/s", 1.0),
    ("_m_s", "mm/s", 1e3),
    ("_rad", "mrad", 1e3),
    ("_ns", "µs", 1e-3),
    ("_m", "µm", 1e6),
    ("_n", "N", 1.0),
    ("_s", "ms", 1e3),
];

/// The unit of the differences of a field, and the size of the one between two values: the distance of two points, the angle
/// between two orientations, otherwise the largest of the elements. None for codes and counts, which have no measure, and
/// where a value is no number.
fn difference(field: &Field, values: &[Vec<Number>; 2]) -> (&'static str, Option<f64>) {
    let [a, b] = values.each_ref().map(|numbers| numbers.iter().map(|number| number.to_f64()));
    let norm = |sign: f64| a.clone().zip(b.clone()).map(|(a, b)| (sign * b - a).powi(2)).sum::<f64>().sqrt();
    // Unlike `max`, this keeps what is no number.
    let larger = |most, size| if size <= most { most } else { size };
    let largest = || a.clone().zip(b.clone()).map(|(a, b)| (b - a).abs()).fold(0.0, larger);
    let name = field.name();
    let (unit, size) = match UNITS.iter().find(|(end, _, _)| name.ends_with(end)) {
        // A quaternion and its negative are one orientation; the chord between two is twice the sine of a quarter.
        _ if name.ends_with("quaternion_wxyz") => {
            ("mrad", 1e3 * 4.0 * (norm(1.0).min(norm(-1.0)) / 2.0).min(1.0).asin())
        }
        _ if name.ends_with("position_m") && a.len() == 3 => ("µm", 1e6 * norm(1.0)),
        Some((_, unit, factor)) => (*unit, factor * largest()),
        None if field.is_integer() => return ("", None),
        None => ("", largest()),
    };
    (unit, size.is_finite().then_some(size))
}

#[cfg(test)]
mod tests {
    use masseter_recording::Columns;

    use super::*;

    fn sized(definition: &str, a: &[f64], b: &[f64]) -> (Option<String>, &'static str) {
        let columns = Columns::from_definition(definition).unwrap();
        let values = [a, b].map(|values| values.iter().copied().map(Number::Real).collect());
        let (unit, size) = difference(&columns.fields()[0], &values);
        (size.map(|size| format!("{size:.3}")), unit)
    }

    #[test]
    fn lengths_are_in_micrometres_angles_in_milliradians_and_codes_without_a_measure() {
        let text = |size: &str| Some(size.to_owned());
        assert_eq!(sized("float64[6] target_m", &[0.1, 0.2], &[0.1, 0.2 + 2e-6]), (text("2.000"), "µm"));
        assert_eq!(sized("float64[3] position_m", &[0.0; 3], &[3e-6, 4e-6, 0.0]), (text("5.000"), "µm"));
        assert_eq!(sized("float64[3] leg_angle_rad", &[1.0], &[1.002]), (text("2.000"), "mrad"));
        assert_eq!(sized("float64[6] joint_m_s", &[1.0], &[1.5]), (text("500.000"), "mm/s"));
        assert_eq!(sized("float64 gain", &[1.0], &[1.5]), (text("0.500"), ""));
        assert_eq!(sized("uint32 request", &[1.0], &[2.0]), (None, ""));
        assert_eq!(sized("float64[6] force_n", &[1.0], &[f64::NAN]), (None, "N"));
    }

    #[test]
    fn the_turn_between_two_quaternions_is_their_angle_whatever_their_signs() {
        let about_x = |angle: f64| [(angle / 2.0).cos(), (angle / 2.0).sin(), 0.0, 0.0];
        let negative = about_x(0.003).map(|part| -part);
        for other in [about_x(0.003), negative] {
            let found = sized("float64[4] quaternion_wxyz", &about_x(0.0), &other);
            assert_eq!(found, (Some("3.000".to_owned()), "mrad"));
        }
    }
}
