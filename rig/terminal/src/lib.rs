//! Output to the terminal, and exit codes.
//!
//! Unlike `println!` and `eprintln!`, nothing here panics: a closed pipe, a closed terminal or a full disk must not end a
//! run. Only [`result`] reports errors. This crate depends on no verb and no file format.
//!
//! ```
//! use masseter_terminal::{result_line, status};
//!
//! status!("measuring for {} s", 10);
//! result_line!("{} cycles", 10_000)?;
//! # Ok::<(), anyhow::Error>(())
//! ```

mod exit;

use std::io::{self, ErrorKind, Write};

use anyhow::Context;
use clap::ValueEnum;

pub use exit::{Exit, Failure, OrFailure};

/// The format of results.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text for people
    #[default]
    Human,
    /// JSON for programs
    Json,
}

/// Writes a result to standard output.
///
/// # Errors
/// When the write fails, except for a closed pipe.
pub fn result(text: &str) -> anyhow::Result<()> {
    let mut output = io::stdout().lock();
    taken(output.write_all(text.as_bytes()).and_then(|()| output.flush()))
}

/// The error of a write to standard output. A closed pipe is none: its reader needs no more.
///
/// # Errors
/// When the write failed for another reason.
pub fn taken(written: io::Result<()>) -> anyhow::Result<()> {
    match written {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(error).context("cannot write standard output")
        }
        _ => Ok(()),
    }
}

/// Writes to standard error in one call, because several processes share it; ignores errors.
pub fn warn(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// Writes a line of a result, like `println!`; evaluates to what [`result`] returns.
#[macro_export]
macro_rules! result_line {
    ($($argument:tt)*) => { $crate::result(&(format!($($argument)*) + "\n")) };
}

/// Writes a status line to standard error, like `eprintln!`.
#[macro_export]
macro_rules! status {
    ($($argument:tt)*) => { $crate::warn(&(format!($($argument)*) + "\n")) };
}
