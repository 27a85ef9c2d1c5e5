//! Events in words, as figures and as `events.jsonl`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::messages::codes::{
    BootPhase, Cause, ControllerState, DriveCondition, EventKind, Source,
};
use masseter_shared::messages::{Event, explain};
use serde::Serialize;

use super::AnalysisError;

/// An event with its codes resolved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventRecord {
    /// When, ns of the run's clock.
    pub time_ns: u64,
    /// Cycle of the process that reported it.
    pub cycle: u64,
    /// Who reported it.
    pub source: String,
    /// What it is.
    pub kind: String,
    /// Why.
    pub cause: String,
    /// The axis concerned.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<&'static str>,
    /// State before and after.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub transition: Option<[String; 2]>,
    /// What is wrong, where, and what to do, where figures alone do not say it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub text: Option<String>,
    /// The value that explains it; none where it is no number.
    pub value: f64,
    /// The limit it is held against.
    pub limit: f64,
}

impl From<&Event> for EventRecord {
    fn from(event: &Event) -> Self {
        let state = |code: u32| {
            if event.source == Source::Controller.code() {
                word(ControllerState::try_from(code).map(ControllerState::name), code)
            } else if event.source == Source::Master.code() {
                word(BootPhase::try_from(code).map(BootPhase::name), code)
            } else {
                word(DriveCondition::try_from(code).map(DriveCondition::name), code)
            }
        };
        let moved = event.from != event.to;
        Self {
            time_ns: event.time_ns,
            cycle: event.cycle,
            source: word(Source::try_from(event.source).map(Source::name), event.source),
            kind: word(EventKind::try_from(event.kind).map(EventKind::name), event.kind),
            cause: word(Cause::try_from(event.cause).map(Cause::name), event.cause),
            axis: AXIS_NAMES.get(event.axis as usize).copied(),
            transition: moved.then(|| [state(event.from), state(event.to)]),
            text: explain(event),
            value: event.value,
            limit: event.limit,
        }
    }
}

/// The name of a code, or the number where this program knows none.
fn word<E>(name: Result<&'static str, E>, code: u32) -> String {
    name.map_or_else(|_| format!("code {code}"), str::to_owned)
}

/// Collects events and writes a line of JSON for each.
pub(super) struct EventLog {
    path: PathBuf,
    file: BufWriter<File>,
    records: Vec<EventRecord>,
}

impl EventLog {
    pub(super) fn create(path: PathBuf) -> Result<Self, AnalysisError> {
        match File::create(&path) {
            Ok(file) => Ok(Self { path, file: BufWriter::new(file), records: Vec::new() }),
            Err(error) => Err(AnalysisError::Write { path, error }),
        }
    }

    pub(super) fn write(&mut self, event: &Event) {
        self.records.push(EventRecord::from(event));
    }

    /// Events in the order of their times.
    pub(super) fn finish(mut self) -> Result<Vec<EventRecord>, AnalysisError> {
        self.records.sort_by_key(|record| record.time_ns);
        match self.write_all() {
            Ok(()) => Ok(self.records),
            Err(error) => Err(AnalysisError::Write { path: self.path, error }),
        }
    }

    fn write_all(&mut self) -> std::io::Result<()> {
        for record in &self.records {
            serde_json::to_writer(&mut self.file, record)?;
            writeln!(self.file)?;
        }
        self.file.flush()
    }
}
