//! `masseter motion`: what a recorded jaw motion holds, and whether the rig would play it.
//!
//! The file is read and the motion judged as `masseter run` does. What differs is the answer: a description, and the
//! values of the scenario with which the motion would fit.

mod description;
mod found;
mod picture;

use masseter_plan::{read_scenario_with, set_keys};
use masseter_terminal::{Tone, result_with_tones};

use crate::prelude::*;

const TONES: [(&str, Tone); 4] =
    [("PLAYS", Tone::Good), ("suggest", Tone::Good), ("warning", Tone::Doubtful), ("REFUSED", Tone::Bad)];

/// The arguments of `motion`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  masseter motion examples/patient.csv --svg patient.svg
  masseter motion jaw.trc --set motion.lowpass_hz=6 --write motion.csv
  masseter motion examples/tracker.csv --scenario examples/markers.toml")]
pub(crate) struct MotionArgs {
    /// File of a recorded jaw motion, as for run --trajectory
    file: PathBuf,
    /// Scenario with the file's axes, the jaw and the mechanism [default: the built-in scenario]
    #[arg(long, value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// Set a key of the scenario
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write the motion in its plain form, with what was read and converted in comments
    #[arg(long, value_name = "FILE.csv")]
    write: Option<PathBuf>,
    /// Write a picture of the motion
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Describes the file. [`Exit::Failed`] where the rig would refuse to play it.
pub(crate) fn motion(args: &MotionArgs) -> anyhow::Result<Exit> {
    let play = |scenario: &mut Scenario| set_keys(scenario, Some(&args.file), &args.set);
    let scenario = read_scenario_with(args.scenario.as_deref(), play)?;
    let found = self::found::Found::new(&scenario, &args.file)?;
    if let (Some(path), masseter_scenario::MotionConfig::File(file)) = (&args.write, &scenario.motion) {
        write_beside(&args.file, path, &masseter_recorded_motion::plain_form(file, &scenario.jaw)?)?;
    }
    if let Some(path) = &args.svg {
        write_beside(&args.file, path, &picture::svg(&found.survey))?;
    }
    match args.format {
        Format::Json => result(&(serde_json::to_string_pretty(&found)? + "\n"))?,
        Format::Human => result_with_tones(&self::description::describe(&found), &TONES)?,
    }
    Ok(if found.judged.refused.is_none() { Exit::Passed } else { Exit::Failed })
}

/// Writes what was made of a recording, but not over it.
fn write_beside(source: &Path, path: &Path, text: &str) -> anyhow::Result<()> {
    if path.canonicalize().is_ok_and(|path| source.canonicalize().is_ok_and(|source| path == source)) {
        bail!("{} is the file that is read; name another one to write", path.display());
    }
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
