//! The messages of one publisher on one topic, side by side.

use std::array;
use std::cmp::Ordering;
use std::collections::{BTreeMap, VecDeque};

use masseter_recording::{Columns, Recorded, Topic};
use serde::Serialize;

use super::field_growth::FieldGrowth;

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
    pub(super) fn settle(&mut self, columns: Option<&Columns>, is_compared: impl Fn(&str) -> bool) {
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
                        self.compare(columns, cycle, bodies.each_ref().map(Recorded::body), &is_compared);
                    }
                }
            }
        }
    }

    fn compare(
        &mut self,
        columns: &Columns,
        cycle: u64,
        bodies: [&[u8]; 2],
        is_compared: impl Fn(&str) -> bool,
    ) {
        for (place, field) in columns.fields().iter().enumerate() {
            let [a, b] = bodies.map(|body| field.bytes(body));
            if a != b && is_compared(field.name()) {
                let growth = self.growths.entry(place);
                growth
                    .or_insert_with(|| FieldGrowth::new(field, cycle, bodies))
                    .take(cycle, FieldGrowth::size(field, bodies));
            }
        }
        let tails = bodies.map(|body| columns.split(body).map_or(body, |(_, tail)| tail));
        if let Some(name) = columns.tail()
            && tails[0] != tails[1]
        {
            let values = tails.map(|tail| data_encoding::HEXUPPER.encode(tail));
            let growth = self.growths.entry(columns.fields().len());
            growth.or_insert_with(|| FieldGrowth::of(name, "", cycle, values)).take(cycle, None);
        }
    }

    fn drop_front(&mut self, side: usize) {
        if let Some((cycle, _)) = self.waiting[side].pop_front() {
            self.missing[side].get_or_insert(Missing { first_cycle: cycle, messages: 0 }).messages += 1;
        }
    }

    /// Ends the comparison: what still waits has no partner. Returns the differing fields, and what only one side has.
    pub(super) fn finish(mut self) -> (Vec<FieldGrowth>, [Option<Missing>; 2]) {
        for side in 0..2 {
            while !self.waiting[side].is_empty() {
                self.drop_front(side);
            }
        }
        let last_cycle = self.last_cycle;
        let growths = self.growths.into_values().map(|growth| growth.finish(last_cycle));
        (growths.collect(), array::from_fn(|side| self.missing[side]))
    }
}
