//! The table `cycles`: a row for each cycle with the values of all named signals, those of requirements.

use masseter_analysis::signals::{NamedSignal, Registry, Sample, Timeline, Values as SignalValues};
use masseter_recording::Recorded;
use masseter_table::{Cell, Column, Table, Values};

use super::topic::{time_cell, time_column};

/// Its name.
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
    pub(super) fn new(registry: Registry, motion_ns: Option<u64>) -> Self {
        let count = registry.signals().len();
        let signals = SignalValues::of_all(registry);
        Self { timeline: Timeline::default(), signals, count, values: Vec::new(), motion_ns }
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

    /// Takes a message; hands out the row of a cycle that is complete now.
    pub(super) fn take(&mut self, message: &Recorded) -> Option<Vec<Cell>> {
        let sample = self.timeline.take(message)?;
        Some(self.row(&sample))
    }

    /// The next row of those that are left once every message has come.
    pub(super) fn finish(&mut self) -> Option<Vec<Cell>> {
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
        row.extend(self.signals().zip(&self.values).map(|(signal, value)| cell(signal, *value)));
        row
    }

    fn signals(&self) -> impl Iterator<Item = &NamedSignal> {
        (0..self.count).map(|place| self.signals.signal(place))
    }
}

/// A value in the signal's unit; the name of a state.
fn cell(signal: &NamedSignal, si: f64) -> Cell {
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
    let unit = unit.to_lowercase();
    if unit.is_empty() || name.ends_with(&format!("_{unit}")) { name } else { format!("{name}_{unit}") }
}
