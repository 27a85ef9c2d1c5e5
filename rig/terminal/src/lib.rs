//! What is said to whoever started the program. A reader that has had enough, a closed terminal or a full disk behind
//! it is no fault of the run, and never ends one: unlike `println!` and `eprintln!`, nothing here panics, and only a
//! result that stands nowhere else may fail.

mod exit;
mod output;

use std::io::{self, ErrorKind, Write};

use anyhow::Context;
use clap::ValueEnum;

pub use exit::{Exit, Failure, OrFailure};
pub use output::{OutputError, new_file, new_folder};

/// How results are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people.
    #[default]
    Human,
    /// For programs.
    Json,
}

/// Writes to standard output what stands in a file as well.
pub fn show(text: &str) {
    let _ = io::stdout().write_all(text.as_bytes());
}

/// Writes a result to standard output, where alone it stands.
pub fn result(text: &str) -> anyhow::Result<()> {
    let mut output = io::stdout().lock();
    taken(output.write_all(text.as_bytes()).and_then(|()| output.flush()))
}

/// What became of a result that was written to standard output: a reader that has had enough is no failure.
pub fn taken(written: io::Result<()>) -> anyhow::Result<()> {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write standard output")
        }
        _ => Ok(()),
    }
}

/// Writes to standard error, in one piece: several processes share it.
pub fn warn(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// A line of a result; as `println!`, but for what [`result`] returns.
#[macro_export]
macro_rules! result_line {
    ($($argument:tt)*) => { $crate::result(&(format!($($argument)*) + "\n")) };
}

/// A line about what goes on, to standard error; as `eprintln!`.
#[macro_export]
macro_rules! status {
    ($($argument:tt)*) => { $crate::warn(&(format!($($argument)*) + "\n")) };
}
