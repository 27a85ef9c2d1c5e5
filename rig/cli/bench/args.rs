//! The arguments of `bench`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use masseter_terminal::Format;

/// The benches.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Kind {
    /// Wake-ups of the real-time loop, against cyclictest
    Loop,
    /// The whole rig at 1 to 20 kHz without bus delays
    Rate,
    /// Whole runs in lockstep and in virtual time, per cycle and against each other
    Simulated,
    /// One motion of 10 s in virtual time without a recording, as suites and campaigns play it
    Virtual,
}

/// The arguments.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter bench loop\n  masseter bench loop rate simulated virtual --out figures"
)]
pub(crate) struct BenchArgs {
    /// What to measure
    #[arg(required = true, value_enum)]
    pub(super) kinds: Vec<Kind>,
    /// Rounds in which the candidates take turns
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(super) rounds: u32,
    /// Cores of the two sides
    #[arg(long, value_name = "N,N", value_parser = crate::cli::arguments::parse_cores, default_value = "0,1")]
    pub(super) cores: [usize; 2],
    /// Folder for results and HdrHistogram logs
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    pub(super) format: Format,
}
