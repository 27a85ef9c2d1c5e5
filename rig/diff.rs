//! `masseter diff`: two recordings, message by message.

use std::path::PathBuf;

use clap::Args;
use masseter_report::divergence;
use masseter_terminal::{Exit, Format};

/// The arguments of `diff`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter diff runs/before runs/after\n  masseter diff golden.mcap runs/latest"
)]
pub(crate) struct DiffArgs {
    /// Run folder, or recording; also a thinned one
    a: PathBuf,
    /// Another one
    b: PathBuf,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// Prints the first message in which two recordings differ, and how each difference grows.
pub(crate) fn diff(args: &DiffArgs) -> anyhow::Result<Exit> {
    divergence::recordings(&args.a, &args.b, args.format)
}
