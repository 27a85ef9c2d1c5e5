//! The program `masseter-parquet`: takes the rows of a table from standard input, and writes a Parquet file to standard
//! output. `masseter` starts it; it is a program of its own, since the crate `parquet` would lengthen every first build.

mod file;

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal};
use std::os::fd::AsFd;
use std::process::ExitCode;
use std::sync::Arc;

use anyhow::{anyhow, bail};
use masseter_table::Rows;
use masseter_terminal::{Exit, OrFailure, status};

use file::ParquetFile;

fn main() -> ExitCode {
    // A write beyond the limit on the size of files is then an error, not the end.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    match write().usage() {
        Ok(()) => Exit::Passed.into(),
        Err(failure) => {
            status!("{:#}", failure.error);
            failure.exit.into()
        }
    }
}

fn write() -> anyhow::Result<()> {
    if std::env::args_os().len() > 1 || io::stdin().is_terminal() || io::stdout().is_terminal() {
        bail!("masseter starts this program: masseter export RUN --format parquet");
    }
    let rows = Rows::new(io::stdin().lock());
    let mut rows = rows.map_err(|error| match error.kind() {
        ErrorKind::InvalidData | ErrorKind::UnexpectedEof => {
            anyhow!(
                "these are no rows of this build of masseter: `cargo build --release` builds both programs"
            )
        }
        _ => error.into(),
    })?;
    let to = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    let mut file = ParquetFile::begin(to, rows.columns())?;
    while let Some(part) = rows.next_part().map_err(unended)? {
        file.write(part.columns())?;
    }
    file.finish()
}

/// Only a sender that died leaves rows without an end.
fn unended(error: io::Error) -> anyhow::Error {
    let is_cut = error.kind() == ErrorKind::UnexpectedEof;
    let error = anyhow::Error::from(error);
    if is_cut { error.context("the rows have no end") } else { error }
}
