//! Events in words, as figures and as `events.jsonl`.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::messages::codes::{
    BootPhase, Cause, ControllerState, EventKind, Source, drive_state_name,
};
use masseter_shared::messages::{Event, explain};
use serde::Serialize;

use super::AnalysisError;
use super::coded::Coded;

/// An event with its codes resolved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventRecord {
    /// When, ns of the run's clock.
    pub time_ns: u64,
    /// Cycle of the process that reported it.
    pub cycle: u64,
    /// Who reported it.
    pub source: Coded<Source>,
    /// What it is.
    pub kind: Coded<EventKind>,
    /// Why.
    pub cause: Coded<Cause>,
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
        let source = Coded::from(event.source);
        let state = |code: u32| match source {
            Coded::Known(Source::Controller) => Coded::<ControllerState>::from(code).to_string(),
            Coded::Known(Source::Master) => Coded::<BootPhase>::from(code).to_string(),
            _ => {
                drive_state_name(code).map_or_else(|unknown| format!("code {}", unknown.code), str::to_owned)
            }
        };
        let moved = event.from != event.to;
        Self {
            time_ns: event.time_ns,
            cycle: event.cycle,
            source,
            kind: event.kind.into(),
            cause: event.cause.into(),
            axis: AXIS_NAMES.get(event.axis as usize).copied(),
            transition: moved.then(|| [state(event.from), state(event.to)]),
            text: explain(event),
            value: event.value,
            limit: event.limit,
        }
    }
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
