//! `masseter report`: the report of a run folder, or the comparison of two.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;

use clap::Args;
use masseter_terminal::{Exit, Failure, Format, OrFailure};
use rustix::fs::Mode;

use crate::run::args::Readers;

/// The arguments of `report`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter report\n  masseter report runs/before runs/after --format json"
)]
pub(crate) struct ReportArgs {
    /// Run folder
    #[arg(default_value = "runs/latest")]
    folder: PathBuf,
    /// Second run folder, to compare with the first
    against: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

impl ReportArgs {
    /// The rights that new files do not get: who may not read the folder may not read them.
    pub(crate) fn umask(&self) -> Mode {
        let folder = fs::metadata(&self.folder).map_or(0, |folder| folder.mode());
        Readers::Owner.umask() & (Readers::All.umask() | Mode::from_bits_truncate(!folder))
    }
}

/// Judges a run again, or compares two runs.
pub(crate) fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    match &args.against {
        None => masseter_report::report_past_run(&args.folder, args.format),
        Some(against) => masseter_report::compare::runs(&args.folder, against, args.format).usage(),
    }
}
