//! The table of a topic: a row for each message, in the order of the recording.

use std::collections::BTreeMap;
use std::iter;

use data_encoding::HEXUPPER;
use masseter_analysis::EventRecord;
use masseter_recording::{Columns, Description, Field, Number, Recorded, Topic};
use masseter_table::{Cell, Column, Table, Values};

/// Fields that say nothing of the message: the version of its layout, and how many values follow.
const LEFT_OUT: [&str; 2] = ["version", "length"];

/// The fields of a topic's messages, and what their definition says of them.
pub(super) struct Shape {
    pub(super) columns: Columns,
    pub(super) descriptions: BTreeMap<String, Description>,
}

/// Makes rows of the messages of a topic.
pub(super) struct TopicTable {
    topic: Topic,
    shape: Shape,
    motion_ns: Option<u64>,
}

impl TopicTable {
    pub(super) fn new(topic: Topic, shape: Shape, motion_ns: Option<u64>) -> Self {
        Self { topic, shape, motion_ns }
    }

    /// The columns without rows.
    pub(super) fn empty(&self) -> Table {
        let mut columns = vec![time_column(
            "Time since the motion began: of the sample, the frame or the event; of other messages that of their publication.",
        )];
        for field in self.fields() {
            let description = self.description(field.name());
            let has_words = !description.codes.is_empty();
            for (place, name) in field.columns().enumerate() {
                let element = if field.is_array() { format!(" Element {place}.") } else { String::new() };
                let values = match (has_words, field.is_integer()) {
                    (true, _) => Values::Words(Vec::new()),
                    (false, true) => Values::Whole(Vec::new()),
                    (false, false) => Values::Numbers(Vec::new()),
                };
                let about = format!("{}{element}", meaning(description));
                columns.push(Column::new(&name, &description.unit, &about, values));
            }
        }
        if let Some(tail) = self.shape.columns.tail() {
            let about = format!("{} In hexadecimal digits.", self.description(tail).meaning);
            columns.push(Column::new(tail, "", &about, Values::Words(Vec::new())));
        }
        if self.topic == Topic::Event {
            columns.extend(event_columns());
        }
        Table::new(columns)
    }

    /// The row of a message.
    pub(super) fn row(&self, message: &Recorded) -> Vec<Cell> {
        // What has another length than its definition has no values.
        let (fixed, tail) = self.shape.columns.split(message.body()).unzip();
        let mut row = vec![time_cell(time_ns(message), self.motion_ns)];
        for field in self.fields() {
            let description = self.description(field.name());
            let cell = |number| cell(field, description, number);
            match fixed {
                Some(fixed) => row.extend(field.numbers(fixed).map(|number| cell(Some(number)))),
                None => row.extend(field.columns().map(|_| cell(None))),
            }
        }
        row.extend(self.shape.columns.tail().map(|_| Cell::Word(tail.map(|bytes| HEXUPPER.encode(bytes)))));
        if let Recorded::Event(event) = message {
            row.extend(event_cells(&EventRecord::from(event)));
        }
        row
    }

    fn fields(&self) -> impl Iterator<Item = &Field> {
        self.shape.columns.fields().iter().filter(|field| !LEFT_OUT.contains(&field.name()))
    }

    fn description(&self, field: &str) -> &Description {
        const NONE: &Description =
            &Description { unit: String::new(), meaning: String::new(), codes: BTreeMap::new() };
        self.shape.descriptions.get(field).unwrap_or(NONE)
    }
}

/// The column of times since the motion began.
pub(super) fn time_column(about: &str) -> Column {
    Column::new("time_s", "s", about, Values::Numbers(Vec::new()))
}

/// The time since the motion began; none without a motion.
pub(super) fn time_cell(time_ns: u64, motion_ns: Option<u64>) -> Cell {
    Cell::Number(motion_ns.map(|motion_ns| time_ns.wrapping_sub(motion_ns).cast_signed() as f64 / 1e9))
}

/// When what a message describes was, ns.
fn time_ns(message: &Recorded) -> u64 {
    match message {
        Recorded::Reading(reading) => reading.sampled_ns,
        Recorded::Truth(truth) => truth.sampled_ns,
        Recorded::Contact(contact) => contact.sampled_ns,
        Recorded::State(state) if state.sampled_ns > 0 => state.sampled_ns,
        Recorded::State(state) => state.due_ns,
        Recorded::Frame(frame) => frame.time_ns,
        Recorded::Event(event) => event.time_ns,
        Recorded::Machine(machine) => machine.time_ns,
        Recorded::Command(_) | Recorded::Signals(_) | Recorded::Parameters(_) => message.published_ns(),
    }
}

fn meaning(Description { meaning, codes, .. }: &Description) -> String {
    if codes.is_empty() {
        return meaning.clone();
    }
    let names: Vec<_> = codes.values().map(String::as_str).collect();
    format!("{meaning} One of {}.", names.join(", "))
}

/// A number; the name of one that is a code, and the number of one without a name.
fn cell(field: &Field, description: &Description, number: Option<Number>) -> Cell {
    if !description.codes.is_empty() {
        let word = |number: Number| {
            let name = u64::try_from(number.to_i64()).ok().and_then(|code| description.codes.get(&code));
            name.cloned().unwrap_or_else(|| format!("code {number}"))
        };
        return Cell::Word(number.map(word));
    }
    if field.is_integer() {
        Cell::Whole(number.map(Number::to_i64))
    } else {
        Cell::Number(number.map(Number::to_f64))
    }
}

/// What the numbers of an event mean beside each other.
fn event_columns() -> impl Iterator<Item = Column> {
    let words = [
        ("axis_name", "Axis concerned; empty when none is."),
        ("state_before", "State before, of a transition."),
        ("state_after", "State after it."),
        ("text", "What is wrong, where, and what to do, where figures alone do not say it."),
    ];
    words.into_iter().map(|(name, about)| Column::new(name, "", about, Values::Words(Vec::new())))
}

fn event_cells(event: &EventRecord) -> impl Iterator<Item = Cell> + use<> {
    let [before, after] = event.transition.clone().map_or([None, None], |states| states.map(Some));
    iter::once(event.axis.map(str::to_owned)).chain([before, after, event.text.clone()]).map(Cell::Word)
}
