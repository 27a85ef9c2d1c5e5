//! `masseter-research uniqueness`: whether the six inputs determine one pose. `prove` and `search` print the results of
//! [`masseter_research::uniqueness`] and write them as CSV.
//!
//! Both are about the published mechanism; a proof around a motion is about its scenario's mechanism.

use std::path::{Path, PathBuf};
use std::{fs::File, io::Write};

use anyhow::Context;
use clap::{Args, Subcommand, ValueEnum};
use masseter_model::geometry::{Mechanism, MechanismConfig};
use masseter_plan::{RunPlan, read_scenario_with, set_keys};
use masseter_recording::new_file;
use masseter_research::uniqueness::{Ambiguous, InputBox, boxes, prove, search};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, result_line, status};

/// The verbs of `uniqueness`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum UniquenessVerb {
    /// Prove by interval arithmetic that no input of a region has two solutions that meet the paper's conditions
    Prove(ProveArgs),
    /// Look for inputs with two solutions that meet the paper's conditions, at random and then uphill
    Search(SearchArgs),
}

/// The arguments of `prove`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter-research uniqueness prove --region jaw\n  masseter-research uniqueness prove --around-mm 1 --scenario examples/patient.toml"
)]
pub(crate) struct ProveArgs {
    /// Which inputs
    #[arg(long, value_enum, default_value_t)]
    region: Region,
    /// Instead of a region: all inputs within this distance, in each axis, of the inputs of a motion
    #[arg(long, value_name = "MM", conflicts_with = "region", value_parser = parse_distance)]
    around_mm: Option<f64>,
    /// Scenario with the motion [default: the built-in scenario, ten seconds of chewing]
    #[arg(long, value_name = "FILE.toml", requires = "around_mm")]
    scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV, TRC, MOT, STO or C3D) instead of the scenario's motion
    #[arg(long, value_name = "FILE", requires = "around_mm")]
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

/// The arguments of `search`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter-research uniqueness search --inputs 100000 --out found.csv")]
pub(crate) struct SearchArgs {
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
enum Region {
    /// Slides within ±5 mm, legs from 260 to 280 mm
    #[default]
    Neutral,
    /// Slides within ±13 mm, legs from 243.6 to 300 mm: contains every jaw motion
    Jaw,
    /// The whole strokes
    Box,
}

/// Proves or searches. Exits with 1 where uniqueness is not proven, or an input with two solutions was found.
pub(crate) fn uniqueness(verb: &UniquenessVerb) -> anyhow::Result<Exit> {
    let is_unique = match verb {
        UniquenessVerb::Prove(args) => prove_and_print(args)?,
        UniquenessVerb::Search(args) => search_and_print(args)?,
    };
    Ok(if is_unique { Exit::Passed } else { Exit::Failed })
}

/// Whether all boxes are proven. Writes the undecided ones.
fn prove_and_print(args: &ProveArgs) -> anyhow::Result<bool> {
    let (mechanism, inputs) = inputs_to_prove(args)?;
    let file = args.out.as_deref().map(new_file).transpose()?;
    let proven = prove(&mechanism, inputs, args.margin, args.boxes, |examined, decided| {
        status!(
            "{} examined, {:.2} % of the volume decided",
            counted(examined as u64, "box"),
            100.0 * decided
        );
    });
    result_line!("boxes examined       {}", proven.examined)?;
    result_line!("no solution          {:.4} % of the volume", 100.0 * proven.unsolvable_share)?;
    result_line!("at most one solution {:.4} % of the volume", 100.0 * proven.unique_share)?;
    result_line!("undecided            {}", counted(proven.undecided.len() as u64, "box"))?;
    write(args.out.as_deref(), file, &proven.table())?;
    Ok(proven.undecided.is_empty())
}

/// Whether no input with two solutions of positive determinants was found. Writes the best inputs found.
fn search_and_print(args: &SearchArgs) -> anyhow::Result<bool> {
    let mechanism = Mechanism::new(&MechanismConfig::default())?;
    let file = args.out.as_deref().map(new_file).transpose()?;
    let found = search(&mechanism, &args.region.inputs(&mechanism), args.inputs, args.seed);
    result_line!("random inputs                                     {}", args.inputs)?;
    result_line!("with a solution that meets the paper's conditions {}", found.with_one)?;
    result_line!("with two of them                                  {}", found.with_two)?;
    result_line!("with two whose determinants are positive          {}", found.both_positive)?;
    if let Some(Ambiguous { lesser, axes_m }) = found.climbed.first() {
        result_line!("greatest lesser determinant, after climbing       {lesser:.4} at {axes_m:?}")?;
    }
    write(args.out.as_deref(), file, &found.table())?;
    Ok(found.climbed.iter().all(|one| one.lesser <= 0.0))
}

/// Writes the text, if a file is named.
fn write(out: Option<&Path>, file: Option<File>, text: &str) -> anyhow::Result<()> {
    let (Some(path), Some(mut file)) = (out, file) else { return Ok(()) };
    file.write_all(text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))
}

/// The mechanism and the boxes of the proof.
fn inputs_to_prove(args: &ProveArgs) -> anyhow::Result<(Mechanism, Vec<InputBox>)> {
    let Some(around_mm) = args.around_mm else {
        let mechanism = Mechanism::new(&MechanismConfig::default())?;
        let inputs = args.region.inputs(&mechanism);
        return Ok((mechanism, vec![inputs]));
    };
    let path = args.scenario.as_deref();
    let played = read_scenario_with(path, |scenario| set_keys(scenario, args.trajectory.as_deref(), &[]))?;
    let plan = RunPlan::of_file(played, path)?;
    let inputs = boxes(&plan, around_mm * 1e-3)?;
    result_line!("{}: {} around its inputs", plan.scenario.name, counted(inputs.len() as u64, "box"))?;
    Ok((plan.mechanism, inputs))
}

fn parse_distance(text: &str) -> Result<f64, &'static str> {
    let distance_mm = text.parse().ok().filter(|mm| *mm > 0.0 && *mm < 100.0);
    distance_mm.ok_or("use a distance above 0 and below 100 mm")
}

/// Above every determinant, or beside them as no number, there is nothing to count, and anything is proven.
fn parse_margin(text: &str) -> Result<f64, &'static str> {
    let margin = text.parse().ok().filter(|margin: &f64| margin.is_finite() && *margin >= 0.0);
    margin.ok_or("use a finite determinant, 0 or above")
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
