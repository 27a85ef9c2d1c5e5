//! CAN frames of a recording as candump logs, one file a bus.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use masseter_can::candump;
use masseter_shared::messages::FrameTap;
use masseter_shared::messages::tap;

use super::{AnalysisError, NOWHERE};

/// Log files, opened as their buses appear.
pub struct CandumpLogs {
    folder: Option<PathBuf>,
    interfaces: Vec<String>,
    buses: Vec<Log>,
    line: String,
}

struct Log {
    path: PathBuf,
    interface: String,
    file: BufWriter<File>,
    logged: Logged,
}

/// What a log holds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Logged {
    /// Frames.
    pub frames: u64,
    /// Error messages, as a `SocketCAN` interface gives them.
    pub errors: u64,
}

impl Log {
    fn create(path: PathBuf, interface: String) -> Result<Self, AnalysisError> {
        match File::create(&path) {
            Ok(file) => Ok(Self { path, interface, file: BufWriter::new(file), logged: Logged::default() }),
            Err(error) => Err(AnalysisError::Write { path, error }),
        }
    }
}

impl CandumpLogs {
    /// Into `folder`, if there is one to take them, with the buses' real interfaces, or `can0`, `can1` and so on where they have none.
    pub fn new(folder: Option<&Path>, interfaces: &[String]) -> Self {
        Self {
            folder: folder.map(Path::to_owned),
            interfaces: interfaces.to_vec(),
            buses: Vec::new(),
            line: String::new(),
        }
    }

    /// Logs a frame.
    ///
    /// # Errors
    /// When the message holds no frame, or the file cannot be written.
    pub fn write(&mut self, frame: &FrameTap) -> Result<(), AnalysisError> {
        let bus = tap::bus_of(frame)?;
        while self.buses.len() <= bus {
            let next = self.buses.len();
            let interface = self.interfaces.get(next).cloned().unwrap_or_else(|| format!("can{next}"));
            let within = |folder: &PathBuf| folder.join(format!("can{next}.log"));
            let path = self.folder.as_ref().map_or_else(|| NOWHERE.into(), within);
            self.buses.push(Log::create(path, interface)?);
        }
        let log = &mut self.buses[bus];
        let tapped = tap::decode(frame)?;
        self.line.clear();
        candump::write(&mut self.line, &log.interface, &tapped).expect("a string takes any text");
        let count = if tapped.frame().is_none() { &mut log.logged.errors } else { &mut log.logged.frames };
        *count += 1;
        writeln!(log.file, "{}", self.line)
            .map_err(|error| AnalysisError::Write { path: log.path.clone(), error })
    }

    /// Of each bus.
    pub fn finish(self) -> Result<Vec<Logged>, AnalysisError> {
        self.buses
            .into_iter()
            .map(|mut log| match log.file.flush() {
                Ok(()) => Ok(log.logged),
                Err(error) => Err(AnalysisError::Write { path: log.path, error }),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::{ErrorKind, ErrorReport, Tapped};

    use super::*;

    #[test]
    fn an_error_message_is_logged_and_is_no_frame() {
        let folder = tempfile::tempdir().unwrap();
        let mut logs = CandumpLogs::new(Some(folder.path()), &[]);
        let report = ErrorReport { time_ns: 2000, port: 1, kind: ErrorKind::Bit, tec: 8, rec: 0 };
        for tap in [FrameTap { id: 0x080, ..FrameTap::default() }, tap::encode(0, &Tapped::Error(report))] {
            logs.write(&tap).unwrap();
        }
        assert_eq!(logs.finish().unwrap(), [Logged { frames: 1, errors: 1 }]);
        let log = std::fs::read_to_string(folder.path().join("can0.log")).unwrap();
        assert_eq!(log.lines().count(), 2, "{log}");
    }

    #[test]
    fn a_frame_on_a_bus_that_no_link_has_makes_no_logs() {
        let folder = tempfile::tempdir().unwrap();
        let mut logs = CandumpLogs::new(Some(folder.path()), &[]);
        let error = logs.write(&FrameTap { bus: u32::MAX, ..FrameTap::default() }).unwrap_err();
        assert!(error.to_string().contains("bus 4294967295"), "{error}");
        assert_eq!(folder.path().read_dir().unwrap().count(), 0);
    }
}
