//! `masseter compare`: recordings of several persons and sessions side by side. The statistics are those of
//! [`masseter_report::study`].

use masseter_recording_verbs::FileFormat;
use masseter_report::study::{self, By, Study};

use crate::prelude::*;

/// The arguments of `compare`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter compare runs/p1-before runs/p1-after runs/p2-before runs/p2-after --out study\n  masseter compare a b --by patient,food.kind"
)]
pub(super) struct CompareArgs {
    /// Run folders, at least two
    #[arg(required = true, num_args = 2..)]
    runs: Vec<PathBuf>,
    /// Two keys: that of the person, and that of the condition within a person
    #[arg(long, value_name = "KEY,KEY", default_value = "patient,session", value_parser = By::parse)]
    by: By,
    /// Change a key of 'study' in every run, which chooses jaw cycles; may be given several times
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Format of the tables
    #[arg(long, value_enum, default_value_t = FileFormat::Csv)]
    format: FileFormat,
    /// Folder for page, figures and tables; must not exist
    #[arg(long, value_name = "DIR", default_value = "comparison")]
    out: PathBuf,
}

/// Compares the runs.
pub(super) fn compare(args: &CompareArgs) -> anyhow::Result<Exit> {
    let format = args.format.of_tables()?;
    let study = Study::read(&args.runs, args.by.clone(), &args.set)?;
    masseter_recording::new_folder(&args.out)?;
    let text = study::write(&study, &args.out, &format)?;
    result(&format!("{text}\ncomparison: {}\n", args.out.join("compare.html").display()))?;
    Ok(Exit::Passed)
}
