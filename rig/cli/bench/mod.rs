//! `masseter bench loop`: wake-up latency of the real-time loop, beside that of cyclictest in the same run.
//!
//! Candidates take turns, round by round, because a machine changes its speed from second to second; the ratio within a
//! round counts ([`candidate`]). No bench judges the rig; [`disturbance`] judges the machine. What only developers
//! measure is in `scripts/bench`.

mod candidate;
mod disturbance;
mod results;
mod wake;

use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, Subcommand};
use masseter_scenario::wording::counted;
use masseter_terminal::{Exit, Failure, Format, OrFailure, result, status};

/// The benches.
#[derive(Debug, Clone, Subcommand)]
pub(super) enum BenchVerb {
    /// Wake-ups of the real-time loop, against cyclictest
    #[command(after_help = "Example:\n  masseter bench loop --out figures")]
    Loop(LoopArgs),
}

/// The arguments of `bench loop`.
#[derive(Debug, Clone, Args)]
pub(super) struct LoopArgs {
    /// Rounds in which the candidates take turns
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Core of the loop
    #[arg(long, value_name = "N", default_value_t = 0)]
    core: usize,
    /// Folder for results and HdrHistogram logs
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Measures, prints and keeps the results; [`Exit::Invalid`] on a disturbed machine.
pub(super) fn execute(BenchVerb::Loop(args): &BenchVerb) -> Result<Exit, Failure> {
    if let Some(folder) = &args.out {
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display())).usage()?;
    }
    status!("bench loop: {} …", counted(args.rounds.into(), "round"));
    let results = wake::measure(args.rounds, args.core).usage()?;
    let json = serde_json::to_string_pretty(&results).context("cannot write the results").usage()? + "\n";
    if let Some(folder) = &args.out {
        results
            .write(folder, &json)
            .with_context(|| format!("cannot write to {}", folder.display()))
            .usage()?;
    }
    result(&if args.format == Format::Json { json } else { results.in_words() }).usage()?;
    Ok(if results.disturbance.disturbed { Exit::Invalid } else { Exit::Passed })
}
