//! Logs of a run beside its report: `events.jsonl`, a line of JSON for each event, and CAN frames as candump logs,
//! `can0.log`, `can1.log` and so on, one file a bus.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use masseter_can::{Tapped, candump};
use masseter_judge::EventRecord;

/// Log files, created as their buses appear.
///
/// ```
/// use masseter_can::{CanId, Frame, Received, Tapped};
/// use masseter_report::CandumpLogs;
///
/// let folder = tempfile::tempdir()?;
/// let frame = Frame::fixed(CanId::standard(0x123)?, [0x11, 0x22]);
/// let mut logs = CandumpLogs::new(folder.path(), &[]);
/// logs.write(0, &Tapped::Frame(Received { frame, time_ns: 1_500_000 }.into()))?;
/// assert_eq!(logs.finish()?, [1]);
/// assert_eq!(std::fs::read_to_string(folder.path().join("can0.log"))?, "(0.001500) can0 123#1122\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CandumpLogs {
    folder: PathBuf,
    interfaces: Vec<String>,
    buses: Vec<Log>,
    line: String,
}

#[derive(Debug)]
struct Log {
    path: PathBuf,
    interface: String,
    file: BufWriter<File>,
    lines: u64,
}

impl CandumpLogs {
    /// Logs in `folder`. They name the real interface of each bus, or `can0`, `can1` and so on where it has none.
    pub fn new(folder: &Path, interfaces: &[String]) -> Self {
        let (folder, interfaces) = (folder.to_owned(), interfaces.to_vec());
        Self { folder, interfaces, buses: Vec::new(), line: String::new() }
    }

    /// Logs a frame of a bus, or an error message as a SocketCAN interface gives it.
    pub fn write(&mut self, bus: usize, tapped: &Tapped) -> Result<(), WriteError> {
        while self.buses.len() <= bus {
            let next = self.buses.len();
            let interface = self.interfaces.get(next).cloned().unwrap_or_else(|| format!("can{next}"));
            let path = self.folder.join(format!("can{next}.log"));
            let file = BufWriter::new(File::create(&path).map_err(WriteError::for_file(&path))?);
            self.buses.push(Log { path, interface, file, lines: 0 });
        }
        let log = &mut self.buses[bus];
        self.line.clear();
        candump::write(&mut self.line, &log.interface, tapped).expect("a string takes any text");
        log.lines += 1;
        writeln!(log.file, "{}", self.line).map_err(WriteError::for_file(&log.path))
    }

    /// Completes the files. Returns the lines of each.
    pub fn finish(self) -> Result<Vec<u64>, WriteError> {
        let finish = |mut log: Log| match log.file.flush() {
            Ok(()) => Ok(log.lines),
            Err(error) => Err(WriteError { path: log.path, error }),
        };
        self.buses.into_iter().map(finish).collect()
    }
}

/// Writes the file.
pub(crate) fn write_events(path: &Path, events: &[EventRecord]) -> Result<(), WriteError> {
    let lines = || -> io::Result<()> {
        let mut file = BufWriter::new(File::create(path)?);
        for event in events {
            serde_json::to_writer(&mut file, event)?;
            writeln!(file)?;
        }
        file.flush()
    };
    lines().map_err(WriteError::for_file(path))
}

/// A file of the report could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    #[source]
    pub error: io::Error,
}

impl WriteError {
    /// For `map_err` after an operation on this file.
    pub(crate) fn for_file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| Self { path: path.to_owned(), error }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::{CanId, ErrorKind, ErrorReport, Frame, TappedFrame};

    use super::*;

    #[test]
    fn an_error_message_is_logged_beside_the_frames_of_its_bus() {
        let folder = tempfile::tempdir().unwrap();
        let mut logs = CandumpLogs::new(folder.path(), &[]);
        let frame = Frame::fixed(CanId::standard(0x080).unwrap(), []);
        let report = ErrorReport { time_ns: 2000, port: 1, kind: ErrorKind::Bit, tec: 8, rec: 0 };
        for tapped in
            [Tapped::Frame(TappedFrame { frame, time_ns: 1000, queued_ns: None }), Tapped::Error(report)]
        {
            logs.write(1, &tapped).unwrap();
        }
        assert_eq!(logs.finish().unwrap(), [0, 2]);
        let log = std::fs::read_to_string(folder.path().join("can1.log")).unwrap();
        assert_eq!(log.lines().count(), 2, "{log}");
    }
}
