//! `masseter diff`: two recordings, message by message.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_recording::{Columns, Digester, Digests, Reader, Recorded, RunFolder, Topic, is_kept};
use masseter_terminal::{Exit, Format, result};

use super::compared::Compared;
use super::comparison::{Comparison, Side};
use super::differences::Differences;

/// What a reader may want to know next.
const FURTHER: &str = "'masseter report A B' compares the figures of two runs.";

/// A recording that is being read.
struct Stream {
    path: PathBuf,
    reader: Reader<BufReader<File>>,
    next: Option<Recorded>,
    /// Of a thinned recording.
    digests: Digests,
    digester: Digester,
}

impl Stream {
    /// Opens a recording, or that of a run folder.
    fn open(path: &Path) -> anyhow::Result<Self> {
        let path = if path.is_dir() { RunFolder::open(path)?.recording() } else { path.to_owned() };
        let name = || path.display().to_string();
        let mut reader = Reader::open(&path).with_context(name)?;
        // Before the first message come the definitions of all channels, and the attached files.
        let next = reader.next_message().with_context(name)?;
        let digests = Digests::attached(reader.attachments());
        Ok(Self { path, reader, next, digests, digester: Digester::default() })
    }

    /// Whether it has the CAN frames, or their digest.
    fn has_frames(&self) -> bool {
        self.reader.has_frames() || self.digests.has(Topic::Frame)
    }

    fn is_thinned(&self) -> bool {
        !self.digests.is_empty()
    }

    fn take(&mut self) -> anyhow::Result<Option<Recorded>> {
        let Some(message) = self.next else { return Ok(None) };
        self.digester.take(&message);
        self.next = self.reader.next_message().with_context(|| self.path.display().to_string())?;
        Ok(Some(message))
    }

    /// The digests of all messages, also of those that a thinned recording does not have. Refuses a damaged recording.
    fn finish(self) -> anyhow::Result<Digests> {
        let path = self.path.display();
        let is_whole = self.reader.damage().is_empty() && !self.reader.was_cut_short();
        ensure!(is_whole, "{path} is incomplete: 'masseter recording verify' says where");
        Ok(if self.digests.is_empty() { self.digester.finish() } else { self.digests })
    }
}

/// `masseter diff A B`.
///
/// ```no_run
/// use masseter_report::divergence;
/// use masseter_terminal::Format;
///
/// divergence::recordings("runs/before".as_ref(), "runs/after".as_ref(), Format::Human)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// When a recording cannot be read to its end.
pub fn recordings(a: &Path, b: &Path, format: Format) -> anyhow::Result<Exit> {
    let differences = compare(Stream::open(a)?, Stream::open(b)?)?;
    result(&match format {
        Format::Human => differences.in_words(["A", "B"]) + FURTHER + "\n",
        Format::Json => serde_json::to_string_pretty(&differences)? + "\n",
    })?;
    Ok(differences.exit())
}

fn compare(mut a: Stream, mut b: Stream) -> anyhow::Result<Differences> {
    let is_in_real_time = a.reader.is_in_real_time() || b.reader.is_in_real_time();
    let compared = if is_in_real_time { Compared::WithoutTimes } else { Compared::Everything };
    let columns = [&a, &b].map(|stream| Columns::of_topics(stream.reader.channels()));
    let mut comparison = Comparison::new(compared, columns);
    if a.has_frames() != b.has_frames() {
        comparison.leave_out(Topic::Frame);
    }
    let is_thinned = a.is_thinned() || b.is_thinned();
    // In turn, so that few messages wait for their partners.
    let mut has_more = true;
    while has_more {
        has_more = false;
        for (side, stream) in [(Side::A, &mut a), (Side::B, &mut b)] {
            if let Some(message) = stream.take()? {
                has_more = true;
                if !is_thinned || is_kept(&message) {
                    comparison.take(side, &message);
                }
            }
        }
    }
    let [a, b] = [a.finish()?, b.finish()?];
    Ok(if is_thinned { comparison.finish_with(&a, &b) } else { comparison.finish() })
}
