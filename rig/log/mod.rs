//! `masseter log`: looks at recordings, proves them complete, saves what is left of damaged ones, and
//! writes them in other tools' formats.
//!
//! `info`, `verify` and `export` end alike: 0 when the recording is whole and complete, 6 when messages or its end are
//! missing, 2 when it holds bytes that Masseter did not write like this. `recover` ends with 0 once it has saved what
//! can be read.

mod choice;
mod columns;
mod export;
mod survey;

use std::fs::{self, File};
use std::io::{BufReader, BufWriter};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand};

use choice::Choice;
use masseter_recording::RunFolder;
use masseter_recording::{Reader, Recovered, recover};
use masseter_terminal::Exit;
use masseter_terminal::result;
use survey::Survey;

/// What `log` does.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum LogVerb {
    /// What is in a recording: topics, schemas, counts, times, sizes
    Info(RecordingArgs),
    /// Whether a recording is whole and complete: checksums, and the sequence numbers of every topic
    Verify(RecordingArgs),
    /// Write what can be read of a damaged recording into a new, whole one
    Recover(RecoverArgs),
    /// Write a recording as CSV, a file a topic, and its CAN frames as candump logs
    Export(ExportArgs),
}

/// Which recording is meant.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecordingArgs {
    /// A recording, or a run folder
    #[arg(default_value = "runs/latest")]
    recording: PathBuf,
}

/// What `recover` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct RecoverArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// The new recording; must not exist [default: beside the old one, with `.recovered` in its name]
    #[arg(long, value_name = "FILE.mcap")]
    out: Option<PathBuf>,
}

/// What `export` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct ExportArgs {
    #[command(flatten)]
    from: RecordingArgs,
    /// Folder for the files; must not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only these topics [default: all that make a table]
    #[arg(long = "topic", value_name = "TOPIC")]
    topics: Vec<String>,
}

impl RecordingArgs {
    /// The recording itself.
    fn path(&self) -> anyhow::Result<PathBuf> {
        if self.recording.is_dir() {
            Ok(RunFolder::open(&self.recording)?.recording())
        } else {
            Ok(self.recording.clone())
        }
    }
}

/// Carries a verb out.
pub(crate) fn run(verb: &LogVerb) -> anyhow::Result<Exit> {
    match verb {
        LogVerb::Info(args) => look(args, Survey::info),
        LogVerb::Verify(args) => look(args, Survey::proof),
        LogVerb::Recover(args) => save(args),
        LogVerb::Export(args) => export(args),
    }
}

fn open(path: &Path) -> anyhow::Result<Reader<BufReader<File>>> {
    Reader::open(path).with_context(|| path.display().to_string())
}

fn look(args: &RecordingArgs, words: impl FnOnce(&Survey) -> String) -> anyhow::Result<Exit> {
    let path = args.path()?;
    let mut reader = open(&path)?;
    let survey = Survey::of(&mut reader).with_context(|| path.display().to_string())?;
    result(&format!("{}\n{}", path.display(), words(&survey)))?;
    Ok(survey.exit())
}

fn save(args: &RecoverArgs) -> anyhow::Result<Exit> {
    let path = args.from.path()?;
    let out = args.out.clone().unwrap_or_else(|| path.with_extension("recovered.mcap"));
    let mut reader = open(&path)?;
    // Nothing is left behind where there is nothing to save.
    let survey = Survey::of(&mut open(&path)?).with_context(|| path.display().to_string())?;
    let file = File::create_new(&out).with_context(|| format!("cannot create {}", out.display()))?;
    let recovered = recover(&mut reader, BufWriter::new(file)).inspect_err(|_| {
        // What went wrong before is the word to say.
        let _ = fs::remove_file(&out);
    })?;
    result(&format!("{}\n{}{}", out.display(), in_words(recovered), survey.loss()))?;
    Ok(Exit::Passed)
}

fn in_words(recovered: Recovered) -> String {
    let saved = format!("{} messages saved\n", recovered.messages);
    match recovered.undefined {
        0 => saved,
        undefined => saved + &format!("{undefined} left behind: their channel is not defined any more\n"),
    }
}

fn export(args: &ExportArgs) -> anyhow::Result<Exit> {
    let path = args.from.path()?;
    let mut reader = open(&path)?;
    let survey = Survey::of(&mut reader).with_context(|| path.display().to_string())?;
    let Choice { tables, left_out } = Choice::of(reader.channels(), &args.topics)?;
    fs::create_dir(&args.out).with_context(|| format!("cannot create {}", args.out.display()))?;
    let written = export::write(&mut open(&path)?, &args.out, tables)?;
    for (name, lines) in written {
        result(&format!("{:>10}  {}\n", lines, args.out.join(name).display()))?;
    }
    for (topic, why) in left_out {
        result(&format!("{:>10}  {topic}: {why}\n", "no table"))?;
    }
    result(&survey.loss())?;
    Ok(survey.exit())
}
