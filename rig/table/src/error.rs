//! Why a table cannot be written.

use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The program that writes Parquet was not built.
    #[error(
        "Parquet files need {}, which does not exist: build it with `cargo build --release`, or install it with \
         `cargo install --path rig/parquet`",
        path.display()
    )]
    NoProgram {
        /// Where it is expected.
        path: PathBuf,
    },
    /// The program that writes Parquet does not start.
    #[error("cannot start {}: {source}; `cargo build --release` builds it again", path.display())]
    NotStarted {
        /// Where it is.
        path: PathBuf,
        /// Why not.
        source: io::Error,
    },
    /// The program that writes Parquet failed, for another reason than a full disk.
    #[error("cannot write the table: masseter-parquet ended with {status}: {said}")]
    Program {
        /// How it ended.
        status: ExitStatus,
        /// What it wrote to standard error.
        said: String,
    },
    /// As CSV.
    #[error("cannot write the table: {0}")]
    Csv(#[from] csv::Error),
    /// The file, or the way to the program that writes it. After a full disk the kind is that of one, in both formats.
    #[error("cannot write the table: {0}")]
    File(#[from] io::Error),
}
