//! HdrHistogram's interval logs (`*.hlog`): a line for each second, written in format V2.

use std::borrow::Borrow;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::Duration;

use hdrhistogram::Histogram;
use hdrhistogram::serialization::V2DeflateSerializer;
use hdrhistogram::serialization::interval_log::{IntervalLogWriterBuilder, IntervalLogWriterError};
use masseter_judge::IntervalFigures;
use masseter_runtime::clock::SECOND_NS;

use crate::logs::WriteError;

/// Time that one line covers, ns.
const INTERVAL_NS: u64 = SECOND_NS;

/// Writes the samples of each interval of a run into `folder`, which is created if it does not exist.
pub(crate) fn write_all(folder: &Path, intervals: &[IntervalFigures]) -> Result<(), WriteError> {
    fs::create_dir_all(folder).map_err(WriteError::for_file(folder))?;
    for interval in intervals {
        let path = folder.join(format!("{}.hlog", interval.name.replace(' ', "-")));
        write(&path, &format!("masseter: {}, ns", interval.name), interval.seconds.iter())
            .map_err(WriteError::for_file(&path))?;
    }
    Ok(())
}

/// Writes a log: the beginning of each second, ns, and its histogram.
fn write<H: Borrow<Histogram<u64>>>(
    path: &Path,
    comment: &str,
    intervals: impl IntoIterator<Item = (u64, H)>,
) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    let mut serializer = V2DeflateSerializer::new();
    let mut log =
        IntervalLogWriterBuilder::new().add_comment(comment).begin_log_with(&mut file, &mut serializer)?;
    let length = Duration::from_nanos(INTERVAL_NS);
    for (start_ns, interval) in intervals {
        log.write_histogram(interval.borrow(), Duration::from_nanos(start_ns), length, None).map_err(
            |error| match error {
                IntervalLogWriterError::IoError(error) => error,
                IntervalLogWriterError::SerializeError(error) => io::Error::other(error),
            },
        )?;
    }
    // A short log fits into the buffer: until here it is in memory only.
    file.flush()
}

#[cfg(test)]
mod tests {
    use data_encoding::BASE64;
    use hdrhistogram::serialization::Deserializer;
    use hdrhistogram::serialization::interval_log::{IntervalLogIterator, LogEntry};
    use masseter_scenario::input::{MOST_KEPT_BYTES, read_bytes};

    use super::*;

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
        write(&path, "a test", seconds()).unwrap();
        let all = read(&path).unwrap();
        assert_eq!((all.len(), all.min(), all.max()), (2, 1000, 2000));
    }

    #[test]
    fn a_log_that_does_not_fit_on_its_disk_is_an_error_however_short_it_is() {
        let error = write(Path::new("/dev/full"), "a test", seconds()).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::StorageFull);
    }

    #[test]
    fn a_log_that_was_cut_is_an_error_wherever_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.hlog");
        write(&path, "a test", seconds()).unwrap();
        let whole = fs::read(&path).unwrap();
        let second_line = whole.iter().position(|byte| *byte == b'\n').unwrap() + 1;
        for length in [whole.len() - 1, whole.len() - 5, second_line + 3] {
            fs::write(&path, &whole[..length]).unwrap();
            assert!(read(&path).is_err(), "{length} of {} bytes", whole.len());
        }
    }
}
