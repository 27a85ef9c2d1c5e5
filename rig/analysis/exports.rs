//! CAN frames of a recording as candump logs, one file a bus.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;

use masseter_shared::can::candump;
use masseter_shared::messages::FrameTap;

use super::AnalysisError;
use crate::run::folder::RunFolder;

/// Log files, opened as their buses appear.
pub(super) struct CandumpLogs {
    folder: RunFolder,
    buses: Vec<Log>,
    line: String,
}

struct Log {
    path: PathBuf,
    file: BufWriter<File>,
    frames: u64,
}

impl Log {
    fn create(path: PathBuf) -> Result<Self, AnalysisError> {
        match File::create(&path) {
            Ok(file) => Ok(Self { path, file: BufWriter::new(file), frames: 0 }),
            Err(error) => Err(AnalysisError::Write { path, error }),
        }
    }
}

impl CandumpLogs {
    pub(super) fn new(folder: &RunFolder) -> Self {
        Self { folder: folder.clone(), buses: Vec::new(), line: String::new() }
    }

    pub(super) fn write(&mut self, tap: &FrameTap) -> Result<(), AnalysisError> {
        let bus = usize::from(tap.bus);
        while self.buses.len() <= bus {
            self.buses.push(Log::create(self.folder.candump(self.buses.len()))?);
        }
        self.line.clear();
        candump::write_tap(&mut self.line, tap)?;
        let log = &mut self.buses[bus];
        log.frames += 1;
        writeln!(log.file, "{}", self.line)
            .map_err(|error| AnalysisError::Write { path: log.path.clone(), error })
    }

    /// Frames on each bus.
    pub(super) fn finish(self) -> Result<Vec<u64>, AnalysisError> {
        self.buses
            .into_iter()
            .map(|mut log| match log.file.flush() {
                Ok(()) => Ok(log.frames),
                Err(error) => Err(AnalysisError::Write { path: log.path, error }),
            })
            .collect()
    }
}
