//! `masseter faults`: the kinds of faults, and the coverage of the rig: what detects each fault, and how far the jaw
//! leaves its path until then.

use masseter_campaign::{FaultRow, fault_matrix_in_words, write_fault_matrix};
use masseter_scenario::{FaultDeclaration, FaultKindConfig};

use crate::prelude::*;
use crate::{run::request::ControllerChoice, run::runner::Runner, vary::matrix};

/// The verbs of `faults`.
#[derive(Debug, Clone, clap::Subcommand)]
pub(super) enum FaultsVerb {
    /// List the kinds of faults with what they stand for
    #[command(after_help = "Example:\n  masseter faults list")]
    List,
    /// Play every kind at every axis and phase of the motion: what detects it, how fast, how far the jaw leaves its
    /// path
    #[command(after_help = "Example:\n  masseter faults matrix --out faults")]
    Matrix(MatrixArgs),
}

/// The arguments of `faults matrix`.
#[derive(Debug, Clone, Args)]
pub(super) struct MatrixArgs {
    /// Scenario file [default: the built-in scenario]
    scenario: Option<PathBuf>,
    /// Folder for matrix.csv and matrix.svg; must not exist
    #[arg(long, value_name = "DIR", default_value = "faults")]
    out: PathBuf,
    /// Only kinds with this text in their names
    #[arg(long, value_name = "TEXT")]
    filter: Option<String>,
}

/// Lists the kinds, or plays the matrix.
pub(super) fn execute(verb: &FaultsVerb) -> Result<Exit, Failure> {
    match verb {
        FaultsVerb::List => list().usage(),
        FaultsVerb::Matrix(args) => play_matrix(args),
    }
}

fn list() -> anyhow::Result<Exit> {
    let line = |kind: &FaultKindConfig| {
        let FaultDeclaration { name, layer, about, .. } = kind.declared();
        format!("{name:<22} {layer:<10} {about}\n")
    };
    result(&FaultKindConfig::ALL.iter().map(line).collect::<String>())?;
    Ok(Exit::Passed)
}

/// Plays the matrix; fails if a fault leads the jaw beyond the limits before somebody detects it.
fn play_matrix(MatrixArgs { scenario, out, filter }: &MatrixArgs) -> Result<Exit, Failure> {
    let read = masseter_plan::read_scenario(scenario.as_deref()).usage()?;
    let plan = masseter_plan::RunPlan::of_file(read, scenario.as_deref()).usage()?;
    let cases = matrix::cases(&plan, filter.as_deref());
    if cases.is_empty() {
        return Err(anyhow!("no kind has this text in its name; see masseter faults list")).usage();
    }
    masseter_recording::new_folder(out).usage()?;
    let runner = Runner::of_verb(ControllerChoice::default())?;
    status!("{} runs", cases.len());
    let rows = matrix::play(&plan.scenario, cases, &runner)?;
    runner.interrupts.restore_default_actions();
    if runner.is_interrupted() {
        // Empty as it is, it would only be in the way of the next matrix.
        let _ = fs::remove_dir(out);
        status!("masseter: interrupted: no table is written");
        return Ok(Exit::Interrupted);
    }
    write_fault_matrix(out, &rows).incomplete()?;
    result(&fault_matrix_in_words(out, &rows)).incomplete()?;
    Ok(if rows.iter().any(FaultRow::is_bad) { Exit::Failed } else { Exit::Passed })
}
