//! `masseter faults`: the kinds of faults, and the coverage of the rig: what detects each fault, and how far the jaw
//! leaves its path until then.

mod args;
mod case;
#[cfg(test)]
mod fault_table;
mod matrix;
mod phases;
mod picture;
mod table;

use clap::Subcommand;
use masseter_scenario::FaultKindConfig;
use masseter_terminal::{Exit, Failure, OrFailure, result};

use args::MatrixArgs;

/// The verbs of `faults`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum FaultsVerb {
    /// List the kinds of faults with what they stand for
    #[command(after_help = "Example:\n  masseter faults list")]
    List,
    /// Play every kind at every axis and phase of the motion: what detects it, how fast, how far the jaw leaves its path
    #[command(after_help = "Example:\n  masseter faults matrix --out faults")]
    Matrix(MatrixArgs),
}

/// Lists the kinds, or plays the matrix.
pub(crate) fn execute(verb: &FaultsVerb) -> Result<Exit, Failure> {
    match verb {
        FaultsVerb::List => list().usage(),
        FaultsVerb::Matrix(args) => matrix::play(args),
    }
}

fn list() -> anyhow::Result<Exit> {
    let line = |kind: &FaultKindConfig| {
        format!("{:<22} {:<10} {}\n", kind.name(), kind.layer().name(), kind.about())
    };
    result(&FaultKindConfig::ALL.iter().map(line).collect::<String>())?;
    Ok(Exit::Passed)
}
