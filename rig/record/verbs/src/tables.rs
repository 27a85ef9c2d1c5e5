//! The tables of `export`. That of a topic has a row for each message, in the order of the recording. `cycles` has a
//! row for each cycle, with the values of all named signals, those of requirements.

use std::iter;

use data_encoding::HEXUPPER;
use masseter_judge::EventRecord;
use masseter_judge::signals::{NamedSignal, Pace, Registry, Sample, Timeline, Values as SignalValues};
use masseter_recording::{Columns, Description, Field, Number, Recorded, Topic};
use masseter_runtime::named::Declared;
use masseter_scenario::Scenario;
use masseter_table::{Cell, Column, Table, Values};

/// Fields that say nothing of the message: the version of its layout, and how many values follow.
const LEFT_OUT: [&str; 2] = ["version", "length"];

/// Makes rows of the messages of a topic.
pub(super) struct TopicTable {
    topic: Topic,
    columns: Columns,
    motion_ns: Option<u64>,
}

impl TopicTable {
    pub(super) fn new(topic: Topic, columns: Columns, motion_ns: Option<u64>) -> Self {
        Self { topic, columns, motion_ns }
    }

    /// The columns without rows.
    pub(super) fn empty(&self) -> Table {
        let mut columns = vec![time_column(
            "Time since the motion began: of the sample, the frame or the event; of other messages that of their publication.",
        )];
        for field in self.fields() {
            let description = &field.description;
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
        if let Some(tail) = self.columns.tail() {
            let about = format!("{} In hexadecimal digits.", tail.description.meaning);
            columns.push(Column::new(tail.name(), "", &about, Values::Words(Vec::new())));
        }
        if self.topic == Topic::Event {
            columns.extend(event_columns());
        }
        Table::new(columns)
    }

    /// The row of a message.
    pub(super) fn row(&self, message: &Recorded) -> Vec<Cell> {
        // What has another length than its definition has no values.
        let (fixed, tail) = self.columns.split(message.body()).unzip();
        let mut row = vec![time_cell(time_ns(message), self.motion_ns)];
        for field in self.fields() {
            match fixed {
                Some(fixed) => row.extend(field.numbers(fixed).map(|number| field_cell(field, Some(number)))),
                None => row.extend(field.columns().map(|_| field_cell(field, None))),
            }
        }
        row.extend(self.columns.tail().map(|_| Cell::Word(tail.map(|bytes| HEXUPPER.encode(bytes)))));
        if let Recorded::Event(event) = message {
            row.extend(event_cells(&EventRecord::from(event)));
        }
        row
    }

    fn fields(&self) -> impl Iterator<Item = &Field> {
        self.columns.fields().iter().filter(|field| !LEFT_OUT.contains(&field.name()))
    }
}

/// The column of times since the motion began.
fn time_column(about: &str) -> Column {
    Column::new("time_s", "s", about, Values::Numbers(Vec::new()))
}

/// The time since the motion began; none without a motion.
fn time_cell(time_ns: u64, motion_ns: Option<u64>) -> Cell {
    Cell::Number(motion_ns.map(|motion_ns| time_ns.wrapping_sub(motion_ns).cast_signed() as f64 / 1e9))
}

/// When what a message describes was, ns.
pub(super) fn time_ns(message: &Recorded) -> u64 {
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
fn field_cell(field: &Field, number: Option<Number>) -> Cell {
    let codes = &field.description.codes;
    if !codes.is_empty() {
        let word = |number: Number| {
            let name = u64::try_from(number.to_i64()).ok().and_then(|code| codes.get(&code));
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
        ("text", "What is wrong, where, and what to do, where figures alone do not show it."),
    ];
    words.into_iter().map(|(name, about)| Column::new(name, "", about, Values::Words(Vec::new())))
}

fn event_cells(event: &EventRecord) -> impl Iterator<Item = Cell> + use<> {
    let [before, after] = event.transition.clone().map_or([None, None], |states| states.map(Some));
    iter::once(event.axis.map(str::to_owned)).chain([before, after, event.text.clone()]).map(Cell::Word)
}

/// The name of the table of cycles.
pub(super) const CYCLES: &str = "cycles";

/// Makes rows of the messages of a recording.
pub(super) struct CycleTable {
    timeline: Timeline,
    signals: SignalValues,
    count: usize,
    /// The values of a cycle.
    values: Vec<f64>,
    motion_ns: Option<u64>,
}

impl CycleTable {
    pub(super) fn new(scenario: &Scenario, declared: &Declared, motion_ns: Option<u64>) -> Self {
        let registry = Registry::new(scenario, declared);
        let count = registry.signals().len();
        let timeline = Timeline::new(scenario, declared, Pace::Recorded);
        Self { timeline, signals: SignalValues::of_all(registry), count, values: Vec::new(), motion_ns }
    }

    /// The columns without rows.
    pub(super) fn empty(&self) -> Table {
        let number = || Values::Whole(Vec::new());
        let mut columns = vec![
            time_column("Time of the sample since the motion began."),
            Column::new("cycle", "", "Number of the cycle, from 1: that of both loops.", number()),
            Column::new("sampled_ns", "ns", "When the drives sampled, by the clock of the run.", number()),
        ];
        columns.extend(self.signals().map(|signal| {
            let is_state = signal.states().is_some();
            let values = if is_state { Values::Words(Vec::new()) } else { Values::Numbers(Vec::new()) };
            Column::new(&column_name(signal), &signal.unit, &signal.about, values)
        }));
        Table::new(columns)
    }

    /// The row of a cycle that is complete with this message.
    pub(super) fn completed_row(&mut self, message: &Recorded) -> Option<Vec<Cell>> {
        let sample = self.timeline.take(message)?;
        Some(self.row(&sample))
    }

    /// The next row of those that are left once every message has come.
    pub(super) fn last_row(&mut self) -> Option<Vec<Cell>> {
        let sample = self.timeline.finish().filter(|sample| !sample.is_closing)?;
        Some(self.row(&sample))
    }

    fn row(&mut self, Sample { time_ns, messages, .. }: &Sample) -> Vec<Cell> {
        self.signals.take(messages, &mut self.values);
        let mut row = vec![
            time_cell(*time_ns, self.motion_ns),
            Cell::Whole(Some(messages.cycle.cast_signed())),
            Cell::Whole(Some(time_ns.cast_signed())),
        ];
        row.extend(self.signals().zip(&self.values).map(|(signal, value)| signal_cell(signal, *value)));
        row
    }

    fn signals(&self) -> impl Iterator<Item = &NamedSignal> {
        (0..self.count).map(|place| self.signals.signal(place))
    }
}

/// A value in the signal's unit; the name of a state.
fn signal_cell(signal: &NamedSignal, si: f64) -> Cell {
    let value = Some(si).filter(|si| !si.is_nan());
    match signal.states() {
        None => Cell::Number(value.map(|si| si / signal.shown().si)),
        Some(states) => Cell::Word(value.map(|code| {
            let name = states.iter().find(|(_, known)| f64::from(*known).to_bits() == code.to_bits());
            name.map_or_else(|| format!("code {code}"), |(name, _)| (*name).to_owned())
        })),
    }
}

/// The signal's name with its unit, in the form of the fields of messages.
fn column_name(signal: &NamedSignal) -> String {
    let name = signal.name.replace('.', "_");
    let unit =
        signal.unit.replace("1/", "per_").replace('/', "_").replace('%', "percent").replace('°', "deg");
    let unit = unit.replace(['µ', 'μ'], "u").to_lowercase();
    if unit.is_empty() || name.ends_with(&format!("_{unit}")) { name } else { format!("{name}_{unit}") }
}
