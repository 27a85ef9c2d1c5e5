//! `masseter recording` (alias `log`): inspects, verifies and recovers recordings; `masseter export` makes tables of them.
//!
//! `info`, `verify` and `extract` end with 0 if the recording is complete, and with 6 if messages or its end are missing. Bytes
//! that Masseter did not write give 2. `recover` ends with 0 once it has saved all readable messages. No verb changes
//! the recording it reads.

use std::fmt::{self, Write as _};
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use masseter_recording::{Reader, new_file, new_folder, recording_at, recover, thin};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, result, result_with_tones};
use mcap::Attachment;

use crate::survey::{Survey, TONES};

/// Verbs of `recording`.
#[derive(Debug, Clone, clap::Subcommand)]
pub enum RecordingVerb {
    /// Print topics, schemas, message counts, times and sizes
    #[command(after_help = "Example:\n  masseter recording info runs/latest")]
    Info(RecordingArgs),
    /// Check checksums and the sequence numbers of every topic
    #[command(after_help = "Example:\n  masseter recording verify runs/latest")]
    Verify(RecordingArgs),
    /// Save the readable messages of a damaged recording in a new one
    #[command(after_help = "Example:\n  masseter recording recover killed/recording.mcap --out whole.mcap")]
    Recover {
        /// The recording to read.
        #[command(flatten)]
        from: RecordingArgs,
        /// New recording; must not exist [default: beside the old one, with '.recovered' in its name]
        #[arg(long, value_name = "FILE.mcap")]
        out: Option<PathBuf>,
    },
    /// Keep few messages and the digests of all: a golden run, small enough for a repository
    #[command(
        after_help = "Example:\n  masseter recording thin runs/latest --out golden.mcap\n\n'masseter diff golden.mcap RUN' compares a later run with it."
    )]
    Thin {
        /// The recording to read.
        #[command(flatten)]
        from: RecordingArgs,
        /// New recording; must not exist
        #[arg(long, value_name = "FILE.mcap")]
        out: PathBuf,
    },
    /// Write the attached files: the scenario, and the recorded motion that it plays
    #[command(after_help = "Example:\n  masseter recording extract recording.mcap --out /tmp/again")]
    Extract {
        /// The recording to read.
        #[command(flatten)]
        from: RecordingArgs,
        /// Folder for the files; must not exist
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

/// The recording to read.
#[derive(Debug, Clone, clap::Args)]
pub struct RecordingArgs {
    /// Recording, run folder, or a link to either
    #[arg(default_value = "runs/latest")]
    recording: PathBuf,
}

impl RecordingArgs {
    /// The file.
    pub(crate) fn path(&self) -> anyhow::Result<PathBuf> {
        Ok(recording_at(&self.recording)?)
    }
}

/// Executes a verb.
pub fn execute(verb: &RecordingVerb) -> anyhow::Result<Exit> {
    match verb {
        RecordingVerb::Info(from) => inspect(&from.path()?, Survey::info),
        RecordingVerb::Verify(from) => inspect(&from.path()?, Survey::verification),
        RecordingVerb::Recover { from, out } => save_readable(&from.path()?, out.as_deref()),
        RecordingVerb::Thin { from, out } => keep_few(&from.path()?, out),
        RecordingVerb::Extract { from, out } => extract(&from.path()?, out),
    }
}

fn inspect(path: &Path, to_text: impl FnOnce(&Survey) -> Result<String, fmt::Error>) -> anyhow::Result<Exit> {
    let survey = Survey::of_file(path)?;
    result_with_tones(&format!("{}\n{}", path.display(), to_text(&survey)?), &TONES)?;
    Ok(survey.exit())
}

fn save_readable(path: &Path, out: Option<&Path>) -> anyhow::Result<Exit> {
    let out = out.map_or_else(|| path.with_extension("recovered.mcap"), Path::to_owned);
    // An unreadable recording must leave no new file behind.
    let survey = Survey::of_file(path)?;
    let recovered = write_new(&out, |medium| Ok(recover(&mut Reader::open(path)?, medium)?))?;
    let mut text = format!("{}\n{} saved\n", out.display(), counted(recovered.messages, "message"));
    if recovered.undefined > 0 {
        writeln!(text, "{} not saved: the definition of their channel is lost", recovered.undefined)?;
    }
    for line in survey.loss()?.lines() {
        writeln!(text, "{}: {line}", path.display())?;
    }
    result(&text)?;
    Ok(Exit::Passed)
}

fn keep_few(path: &Path, out: &Path) -> anyhow::Result<Exit> {
    let named = || path.display().to_string();
    let mut reader = Reader::open(path).with_context(named)?;
    let kept = write_new(out, |medium| thin(&mut reader, medium).with_context(named))?;
    result(&format!("{}\n{} and the digests of all\n", out.display(), counted(kept, "message")))?;
    Ok(Exit::Passed)
}

/// Writes a new file, which is removed again where that fails. The first error is the one to report.
fn write_new<T>(path: &Path, write: impl FnOnce(BufWriter<File>) -> anyhow::Result<T>) -> anyhow::Result<T> {
    write(BufWriter::new(new_file(path)?)).inspect_err(|_| {
        let _ = fs::remove_file(path);
    })
}

fn extract(path: &Path, out: &Path) -> anyhow::Result<Exit> {
    let survey = Survey::of_file(path)?;
    for (name, bytes) in write_attached(survey.reader.attachments(), out)? {
        result(&format!("{bytes:>10}  {}\n", out.join(name).display()))?;
    }
    result(&survey.loss_with_advice()?)?;
    Ok(survey.exit())
}

/// Writes all attached files into a new folder. Returns their names and lengths, bytes. Refuses names that lead out of the
/// folder.
fn write_attached<'a>(
    attachments: &'a [Attachment<'static>],
    folder: &Path,
) -> anyhow::Result<Vec<(&'a str, usize)>> {
    ensure!(!attachments.is_empty(), "no file is attached to the recording");
    for Attachment { name, .. } in attachments {
        let is_plain = Path::new(name).file_name() == Some(std::ffi::OsStr::new(name));
        ensure!(is_plain, "a file is attached as '{name}', which is not the plain name of a file");
    }
    new_folder(folder)?;
    let write = |file: &'a Attachment<'static>| {
        let path = folder.join(&file.name);
        let written = File::create_new(&path).and_then(|mut created| created.write_all(&file.data));
        written.with_context(|| format!("cannot write {}", path.display()))?;
        Ok((file.name.as_str(), file.data.len()))
    };
    attachments.iter().map(write).collect()
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;

    use super::*;

    #[test]
    fn no_name_leads_out_of_the_folder_and_nothing_is_written_then() {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("new");
        let attached = |name: &str| Attachment {
            log_time: 0,
            create_time: 0,
            name: name.to_owned(),
            media_type: String::new(),
            data: Cow::Borrowed(b"any"),
        };
        for name in ["", ".", "..", "/etc/any", "../any", "any/", "any/..", "a/b"] {
            let error = write_attached(&[attached("good"), attached(name)], &folder).unwrap_err().to_string();
            assert!(error.contains(&format!("'{name}'")), "{error}");
            assert!(!folder.exists(), "{name}");
        }
        assert_eq!(write_attached(&[attached("good")], &folder).unwrap(), [("good", 3)]);
        assert_eq!(fs::read(folder.join("good")).unwrap(), b"any");
    }
}
