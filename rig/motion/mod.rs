//! `masseter motion`: what a recorded jaw motion holds, and whether the rig would play it.
//!
//! The file is read and the motion judged as `masseter run` does. What differs is the answer: a description, and the
//! values of the scenario with which the motion would fit.

mod found;
mod picture;
mod strokes;
mod suggestion;
mod text;

use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use masseter_controller::trajectory::survey;
use masseter_model::geometry::Mechanism;
use masseter_plan::{Overrides, scenario_with_overrides};
use masseter_scenario::{FileConfig, MotionConfig, Scenario};
use masseter_terminal::{Exit, Format, Tone, result, result_with_tones};

use found::Found;
use strokes::{judge, strokes};

const TONES: [(&str, Tone); 4] =
    [("PLAYS", Tone::Good), ("suggest", Tone::Good), ("warning", Tone::Doubtful), ("REFUSED", Tone::Bad)];

/// The arguments of `motion`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  masseter motion examples/patient.csv --svg patient.svg
  masseter motion examples/tracker.csv --scenario examples/markers.toml")]
pub(crate) struct MotionArgs {
    /// CSV file of a recorded jaw motion, as for run --trajectory
    file: PathBuf,
    /// Scenario with the file's axes, the jaw and the mechanism [default: the default one]
    #[arg(long, value_name = "SCENARIO.toml")]
    scenario: Option<PathBuf>,
    /// Set a key of the scenario
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Write a picture of the motion
    #[arg(long, value_name = "FILE.svg")]
    svg: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Describes the file. [`Exit::Failed`] where the rig would refuse to play it.
pub(crate) fn motion(args: &MotionArgs) -> anyhow::Result<Exit> {
    let overrides =
        Overrides { set: args.set.clone(), trajectory: Some(args.file.clone()), ..Overrides::default() };
    let scenario = scenario_with_overrides(args.scenario.as_deref(), &overrides)?;
    let found = examine(&scenario, args)?;
    if let Some(path) = &args.svg {
        let drawn = picture::svg(&found.survey).context("cannot draw the motion")?;
        fs::write(path, drawn).with_context(|| format!("cannot write {}", path.display()))?;
    }
    match args.format {
        Format::Json => result(&(serde_json::to_string_pretty(&found)? + "\n"))?,
        Format::Human => result_with_tones(&text::text(&found), &TONES)?,
    }
    Ok(if found.refused.is_none() { Exit::Passed } else { Exit::Failed })
}

fn examine(scenario: &Scenario, args: &MotionArgs) -> anyhow::Result<Found> {
    let file = file_of(scenario).context("the scenario plays no file")?;
    let survey = survey(file, &scenario.jaw)?;
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let judged = judge(scenario, &mechanism).map(|(_, report)| strokes(&report, &mechanism));
    let suggestion =
        suggestion::suggest(scenario, &mechanism, survey.likely_axes.as_ref(), judged.as_ref().ok());
    Ok(Found {
        file: args.file.clone(),
        survey,
        strokes: judged.as_ref().ok().copied(),
        refused: judged.err().map(|error| error.to_string()),
        suggestion,
    })
}

fn file_of(scenario: &Scenario) -> Option<&FileConfig> {
    match &scenario.motion {
        MotionConfig::File(file) => Some(file),
        _ => None,
    }
}
