//! `masseter recording` (alias `log`): inspects, verifies and recovers recordings; `masseter export` makes tables of them.
//!
//! `info`, `verify` and `extract` end with 0 if the recording is complete, 6 if messages or its end are missing, and 2 if it
//! holds bytes that Masseter did not write. `recover` ends with 0 once it has saved what is readable. No verb changes
//! the recording it reads.

mod attached;
pub(crate) mod survey;

use std::fmt::{self, Write};
use std::fs::{self, File};
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand};
use masseter_recording::{Reader, Recovered, RunFolder, recover, thin};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, result, result_with_tones};

use survey::Survey;

/// Verbs of `recording`.
#[derive(Debug, Clone, Subcommand)]
pub enum RecordingVerb {
    /// Print topics, schemas, message counts, times and sizes
    #[command(after_help = "Example:\n  masseter recording info runs/latest")]
    Info(RecordingArgs),
    /// Check checksums and the sequence numbers of every topic
    #[command(after_help = "Example:\n  masseter recording verify runs/latest")]
    Verify(RecordingArgs),
    /// Save the readable messages of a damaged recording in a new one
    Recover(RecoverArgs),
    /// Keep few messages and the digests of all: a golden run, small enough for a repository
    Thin(ThinArgs),
    /// Write the attached files: the scenario, and the recorded motion that it plays
    Extract(ExtractArgs),
}

/// The recording to read.
#[derive(Debug, Clone, Args)]
pub struct RecordingArgs {
    /// Recording, or run folder
    #[arg(default_value = "runs/latest")]
    recording: PathBuf,
}

/// The arguments of `recover`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter recording recover killed/recording.mcap --out whole.mcap")]
pub struct RecoverArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// New recording; must not exist [default: beside the old one, with '.recovered' in its name]
    #[arg(long, value_name = "FILE.mcap")]
    out: Option<PathBuf>,
}

/// The arguments of `thin`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Example:\n  masseter recording thin runs/latest --out golden.mcap\n\n'masseter diff golden.mcap RUN' compares a later run with it."
)]
pub struct ThinArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// New recording; must not exist
    #[arg(long, value_name = "FILE.mcap")]
    out: PathBuf,
}

/// The arguments of `extract`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter recording extract recording.mcap --out /tmp/again")]
pub struct ExtractArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// Folder for the files; must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl RecordingArgs {
    /// The file.
    pub(crate) fn path(&self) -> anyhow::Result<PathBuf> {
        if self.recording.is_dir() {
            Ok(RunFolder::open(&self.recording)?.recording())
        } else {
            Ok(self.recording.clone())
        }
    }
}

/// Executes a verb.
pub fn execute(verb: &RecordingVerb) -> anyhow::Result<Exit> {
    match verb {
        RecordingVerb::Info(args) => inspect(args, Survey::info),
        RecordingVerb::Verify(args) => inspect(args, Survey::verification),
        RecordingVerb::Recover(args) => save_readable(args),
        RecordingVerb::Thin(args) => keep_few(args),
        RecordingVerb::Extract(args) => extract(args),
    }
}

fn open(path: &Path) -> anyhow::Result<Reader<BufReader<File>>> {
    Reader::open(path).with_context(|| path.display().to_string())
}

/// Reads a recording to its end.
fn survey(path: &Path, reader: &mut Reader<BufReader<File>>) -> anyhow::Result<Survey> {
    Survey::read(reader).with_context(|| path.display().to_string())
}

fn inspect(
    args: &RecordingArgs,
    to_text: impl FnOnce(&Survey) -> Result<String, fmt::Error>,
) -> anyhow::Result<Exit> {
    let path = args.path()?;
    let survey = survey(&path, &mut open(&path)?)?;
    result_with_tones(&format!("{}\n{}", path.display(), to_text(&survey)?), &survey::TONES)?;
    Ok(survey.exit())
}

fn save_readable(args: &RecoverArgs) -> anyhow::Result<Exit> {
    let path = args.from.path()?;
    let out = args.out.clone().unwrap_or_else(|| path.with_extension("recovered.mcap"));
    // An unreadable recording must leave no new file behind.
    let survey = survey(&path, &mut open(&path)?)?;
    let file = File::create_new(&out).with_context(|| format!("cannot create {}", out.display()))?;
    let recovered = recover(&mut open(&path)?, BufWriter::new(file)).inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_file(&out);
    })?;
    let mut text = format!("{}\n{}", out.display(), recovered_text(recovered));
    for line in survey.loss()?.lines() {
        writeln!(text, "{}: {line}", path.display())?;
    }
    result(&text)?;
    Ok(Exit::Passed)
}

fn keep_few(args: &ThinArgs) -> anyhow::Result<Exit> {
    let (path, out) = (args.from.path()?, &args.out);
    let mut reader = open(&path)?;
    let file = File::create_new(out).with_context(|| format!("cannot create {}", out.display()))?;
    let kept = thin(&mut reader, BufWriter::new(file)).inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_file(out);
    });
    let kept = kept.with_context(|| path.display().to_string())?;
    result(&format!("{}\n{} and the digests of all\n", out.display(), counted(kept, "message")))?;
    Ok(Exit::Passed)
}

fn recovered_text(recovered: Recovered) -> String {
    let saved = format!("{} saved\n", counted(recovered.messages, "message"));
    match recovered.undefined {
        0 => saved,
        undefined => saved + &format!("{undefined} not saved: the definition of their channel is lost\n"),
    }
}

fn extract(args: &ExtractArgs) -> anyhow::Result<Exit> {
    let path = args.from.path()?;
    let mut reader = open(&path)?;
    let survey = survey(&path, &mut reader)?;
    for (name, bytes) in attached::write(reader.attachments(), &args.out)? {
        result(&format!("{bytes:>10}  {}\n", args.out.join(name).display()))?;
    }
    result(&survey.loss_with_advice()?)?;
    Ok(survey.exit())
}
