//! The arguments of `masseter faults matrix`.

use std::path::PathBuf;

use clap::Args;

/// The arguments of `faults matrix`.
#[derive(Debug, Clone, Args)]
pub(crate) struct MatrixArgs {
    /// Scenario file [default: chewing]
    pub(super) scenario: Option<PathBuf>,
    /// Folder for matrix.csv and matrix.svg; must not exist
    #[arg(long, value_name = "DIR", default_value = "faults")]
    pub(super) out: PathBuf,
    /// Only kinds with this text in their names
    #[arg(long, value_name = "TEXT")]
    pub(super) filter: Option<String>,
}
