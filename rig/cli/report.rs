//! The verbs for past runs: `masseter report` writes a report again or compares two runs, `masseter replay` repeats the
//! decisions of a controller, `masseter diff` compares two recordings message by message.

use std::os::unix::fs::MetadataExt;

use rustix::fs::Mode;

use crate::BUILD;
use crate::prelude::*;
use crate::record::replay::{self, Replayed};
use crate::run::request::{ControllerKind, Readers};

/// The arguments of `report`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter report\n  masseter report runs/before runs/after --format json"
)]
pub(super) struct ReportArgs {
    /// Run folder, its recording.mcap, or a link to either
    #[arg(default_value = "runs/latest")]
    folder: PathBuf,
    /// Second run, to compare with the first
    against: Option<PathBuf>,
    /// Change a key of 'study', which chooses jaw cycles; may be given several times
    #[arg(long, value_name = "KEY=VALUE", conflicts_with = "against")]
    set: Vec<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

impl ReportArgs {
    /// The rights that new files do not get: who may not read the folder may not read them.
    pub(super) fn umask(&self) -> Mode {
        let folder = RunFolder::open(&self.folder).ok().and_then(|run| fs::metadata(run.path()).ok());
        let folder = folder.map_or(0, |folder| folder.mode());
        Readers::Owner.umask() & (Readers::All.umask() | Mode::from_bits_truncate(!folder))
    }
}

/// Judges a run again, or compares two runs.
pub(super) fn report(args: &ReportArgs) -> Result<Exit, Failure> {
    match &args.against {
        None => masseter_report::report_past_run(&args.folder, &args.set, args.format),
        Some(against) => masseter_report::compare::runs(&args.folder, against, args.format).usage(),
    }
}

/// The arguments of `diff`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter diff runs/before runs/after\n  masseter diff golden.mcap runs/latest"
)]
pub(super) struct DiffArgs {
    /// Run folder, or recording; also a thinned one
    a: PathBuf,
    /// Another one
    b: PathBuf,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints the first message in which two recordings differ, and how each difference grows.
pub(super) fn diff(args: &DiffArgs) -> anyhow::Result<Exit> {
    masseter_report::divergence::recordings(&args.a, &args.b, args.format)
}

/// The arguments of `replay`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter replay runs/latest\n  masseter replay runs/latest --set controller.integral_gain_per_s=7.00001"
)]
pub(super) struct ReplayArgs {
    /// Run folder, its recording.mcap, or a link to either
    #[arg(default_value = "runs/latest")]
    run: PathBuf,
    /// Which controller answers [default: that of the run]
    #[arg(long, value_enum)]
    controller: Option<ControllerKind>,
    /// Change a key of the scenario; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Replays a run, and prints where its controller answers otherwise.
pub(super) fn replay(args: &ReplayArgs) -> anyhow::Result<Exit> {
    let replayed = replay::replay(&args.run, args.controller, &args.set)?;
    result(&match args.format {
        Format::Human => in_words(&replayed),
        Format::Json => serde_json::to_string_pretty(&replayed)? + "\n",
    })?;
    Ok(replayed.differences.exit())
}

fn in_words(Replayed { controller, clock, cycles, differences, recorded_by, .. }: &Replayed) -> String {
    let other = format!("; recorded by masseter {recorded_by}, replayed by {BUILD}");
    let other = if recorded_by == BUILD { "" } else { &other };
    format!(
        "{}{cycles} cycles of the {clock} clock by the controller '{controller}', in open loop: the readings are the recorded \
         ones, whatever the controller answers{other}\n",
        differences.in_words(["the recording", "the replay"])
    )
}
