//! `masseter uniqueness`: how far an input settles the pose. `prove` proves it for a region of inputs,
//! `search` looks for inputs with two solutions that count. Both are about the published mechanism; a proof around a
//! motion is about its scenario's.

mod motion;
mod proof;
mod search;

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use masseter_controller::kinematics::uniqueness::InputBox;
use masseter_shared::geometry::{GeometryError, Mechanism, MechanismConfig};

use masseter_plan::RunPlan;
use masseter_terminal::{Exit, result_line};

/// What `uniqueness` does.
#[derive(Debug, Clone, Subcommand)]
pub enum UniquenessVerb {
    /// Prove by interval arithmetic that no input of a region has two solutions that meet the paper's conditions
    Prove(ProveArgs),
    /// Look for inputs with two solutions that meet the paper's conditions, at random and then uphill
    Search(SearchArgs),
}

/// What `prove` takes.
#[derive(Debug, Clone, Args)]
pub struct ProveArgs {
    /// Which inputs
    #[arg(long, value_enum, default_value_t)]
    region: Region,
    /// Instead of a region: all inputs at most so far, in each axis, from those of a motion
    #[arg(long, value_name = "MM", conflicts_with = "region", value_parser = parse_distance)]
    around_mm: Option<f64>,
    /// Scenario whose motion is meant [default: ten seconds of chewing]
    #[arg(long, value_name = "FILE.toml", requires = "around_mm")]
    scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV) instead of the scenario's motion
    #[arg(long, value_name = "FILE.csv", requires = "around_mm")]
    trajectory: Option<PathBuf>,
    /// Boxes to examine at most
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    boxes: usize,
    /// Count only solutions whose determinant is at least this [default: the paper's conditions alone]
    #[arg(long, value_name = "DETERMINANT", value_parser = parse_margin)]
    margin: Option<f64>,
    /// CSV file for the boxes that stay undecided; must not exist
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

/// What `search` takes.
#[derive(Debug, Clone, Args)]
pub struct SearchArgs {
    /// Which inputs
    #[arg(long, value_enum, default_value = "box")]
    region: Region,
    /// Random inputs
    #[arg(long, value_name = "N", default_value_t = 400_000)]
    inputs: usize,
    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// CSV file for the inputs found; must not exist
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
}

/// Boxes of inputs.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Region {
    /// Slides within ±5 mm, legs from 260 to 280 mm
    #[default]
    Neutral,
    /// Slides within ±13 mm, legs from 243.6 to 300 mm: what holds every jaw motion
    Jaw,
    /// The whole strokes
    Box,
}

/// Carries a verb out. Exits with 1 where uniqueness is not proven, or an input with two was found.
pub fn uniqueness(verb: &UniquenessVerb) -> anyhow::Result<Exit> {
    let settled = match verb {
        UniquenessVerb::Prove(args) => {
            let (mechanism, wholes) = to_prove(args)?;
            with_output(args.out.as_deref(), || proof::prove(args, &mechanism, wholes))?
        }
        UniquenessVerb::Search(args) => {
            let mechanism = published()?;
            with_output(args.out.as_deref(), || search::search(args, &mechanism))?
        }
    };
    Ok(if settled { Exit::Passed } else { Exit::Failed })
}

/// Does the work and writes its rows to a new file, if one is named. Whether all was settled.
fn with_output(
    out: Option<&Path>,
    work: impl FnOnce() -> anyhow::Result<(bool, Vec<String>)>,
) -> anyhow::Result<bool> {
    let file = out.map(masseter_terminal::new_file).transpose()?;
    let (settled, rows) = work()?;
    if let (Some(path), Some(file)) = (out, file) {
        write_rows(file, &rows).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(settled)
}

/// The mechanism and the boxes that something is to be proven of.
fn to_prove(args: &ProveArgs) -> anyhow::Result<(Mechanism, Vec<InputBox>)> {
    let Some(around_mm) = args.around_mm else {
        let mechanism = published()?;
        let whole = args.region.inputs(&mechanism);
        return Ok((mechanism, vec![whole]));
    };
    let plan = RunPlan::new(masseter_plan::read_scenario_with(args.scenario.as_deref(), |scenario| {
        if let Some(path) = &args.trajectory {
            masseter_plan::play_file(path, scenario);
        }
        Ok(())
    })?)?;
    let wholes = motion::boxes(&plan, around_mm * 1e-3)?;
    result_line!("{}: {} boxes around its inputs", plan.scenario.name, wholes.len())?;
    Ok((plan.mechanism, wholes))
}

fn parse_distance(text: &str) -> Result<f64, String> {
    let distance_mm: f64 = text.parse().map_err(|_| format!("{text} is no number"))?;
    if distance_mm > 0.0 && distance_mm < 100.0 {
        Ok(distance_mm)
    } else {
        Err("use a distance above 0 and below 100 mm".to_owned())
    }
}

/// Above every determinant, or beside them as no number, there is nothing to count, and anything is proven.
fn parse_margin(text: &str) -> Result<f64, String> {
    let margin: f64 = text.parse().map_err(|_| format!("{text} is no number"))?;
    if margin.is_finite() && margin >= 0.0 {
        Ok(margin)
    } else {
        Err("use a finite determinant, 0 or above".to_owned())
    }
}

fn published() -> Result<Mechanism, GeometryError> {
    Mechanism::new(&MechanismConfig::default())
}

fn write_rows(file: File, rows: &[String]) -> io::Result<()> {
    let mut file = BufWriter::new(file);
    for row in rows {
        writeln!(file, "{row}")?;
    }
    file.flush()
}

impl Region {
    fn inputs(self, mechanism: &Mechanism) -> InputBox {
        match self {
            Self::Neutral => InputBox::uniform([-0.005, 0.005], [0.26, 0.28]),
            Self::Jaw => InputBox::uniform([-0.013, 0.013], [0.2436, 0.30]),
            Self::Box => InputBox::uniform(mechanism.strokes().slide_m, mechanism.strokes().leg_m),
        }
    }
}
