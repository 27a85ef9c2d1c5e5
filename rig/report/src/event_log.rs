//! `events.jsonl`: the events of a run, a line of JSON each.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use masseter_analysis::EventRecord;

use crate::write_error::WriteError;

/// Writes the file.
pub(crate) fn write(path: &Path, events: &[EventRecord]) -> Result<(), WriteError> {
    write_lines(path, events).map_err(WriteError::for_file(path))
}

fn write_lines(path: &Path, events: &[EventRecord]) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    for event in events {
        serde_json::to_writer(&mut file, event)?;
        writeln!(file)?;
    }
    file.flush()
}
