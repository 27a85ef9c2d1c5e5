//! Logs of a run beside its report: `events.jsonl`, a line of JSON for each event; CAN frames as candump logs, `can0.log`,
//! `can1.log` and so on, one file a bus; and HdrHistogram's interval logs (`*.hlog`), a line for each second in format V2.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, IntervalLogWriterError};
use hdrhistogram::{Histogram, serialization::V2DeflateSerializer};
use masseter_can::{Tapped, candump};
use masseter_judge::{EventRecord, IntervalFigures};

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

/// Writes the samples of each interval of a run into `folder`, which is created if it does not exist.
pub(crate) fn write_histograms(folder: &Path, intervals: &[IntervalFigures]) -> Result<(), WriteError> {
    fs::create_dir_all(folder).map_err(WriteError::for_file(folder))?;
    for interval in intervals {
        let path = folder.join(format!("{}.hlog", interval.name.replace(' ', "-")));
        write_histogram_log(&path, &format!("masseter: {}, ns", interval.name), interval.seconds.iter())
            .map_err(WriteError::for_file(&path))?;
    }
    Ok(())
}

/// Writes a log: the beginning of each second, ns, and its histogram.
fn write_histogram_log(
    path: &Path,
    comment: &str,
    seconds: impl IntoIterator<Item = (u64, Histogram<u64>)>,
) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let mut serializer = V2DeflateSerializer::new();
    let mut log =
        IntervalLogWriterBuilder::new().add_comment(comment).begin_log_with(&mut file, &mut serializer)?;
    for (start_ns, second) in seconds {
        let written =
            log.write_histogram(&second, Duration::from_nanos(start_ns), Duration::from_secs(1), None);
        written.map_err(|error| match error {
            IntervalLogWriterError::IoError(error) => error,
            IntervalLogWriterError::SerializeError(error) => io::Error::other(error),
        })?;
    }
    // A short log fits into the buffer: until here it is in memory only.
    file.flush()
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
    use data_encoding::BASE64;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
    use masseter_can::{CanId, ErrorKind, ErrorReport, Frame, TappedFrame};
    use masseter_runtime::clock::SECOND_NS;
    use masseter_scenario::input::{MOST_KEPT_BYTES, read_bytes};

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

    /// Reads all seconds of a log into one histogram.
    fn read(path: &Path) -> io::Result<Histogram<u64>> {
        let text = read_bytes(path, MOST_KEPT_BYTES)?;
        let mut all = Histogram::new(3).expect("three digits are allowed");
        for entry in IntervalLogIterator::new(&text) {
            let entry = entry.map_err(|error| invalid(format!("a line holds no interval: {error:?}")))?;
            let LogEntry::Interval(interval) = entry else { continue };
            let bytes = BASE64.decode(interval.encoded_histogram().as_bytes()).map_err(invalid)?;
            let interval: Histogram<u64> =
                Deserializer::new().deserialize(&mut bytes.as_slice()).map_err(invalid)?;
            all.add(interval).map_err(invalid)?;
        }
        Ok(all)
    }

    fn invalid(error: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> io::Error {
        io::Error::new(io::ErrorKind::InvalidData, error)
    }

    fn seconds() -> [(u64, Histogram<u64>); 2] {
        [(0, 1000), (SECOND_NS, 2000)].map(|(start_ns, value_ns)| {
            let mut second = Histogram::new(3).unwrap();
            second.record(value_ns).unwrap();
            (start_ns, second)
        })
    }

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hlog");
        write_histogram_log(&path, "a test", seconds()).unwrap();
        let all = read(&path).unwrap();
        assert_eq!((all.len(), all.min(), all.max()), (2, 1000, 2000));
    }

    #[test]
    fn a_log_that_does_not_fit_on_its_disk_is_an_error_however_short_it_is() {
        let error = write_histogram_log(Path::new("/dev/full"), "a test", seconds()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn a_log_that_was_cut_is_an_error_wherever_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hlog");
        write_histogram_log(&path, "a test", seconds()).unwrap();
        let whole = fs::read(&path).unwrap();
        let second_line = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for length in [whole.len() - 1, whole.len() - 5, second_line + 3] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "{length} of {} bytes", whole.len());
        }
    }
}
