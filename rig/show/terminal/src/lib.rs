//! Output to the terminal, and exit codes.
//!
//! Unlike `println!` and `eprintln!`, nothing here panics: a closed pipe, a closed terminal or a full disk must not end a
//! run. Only [`result`] reports errors. Control characters are written as their codes, since names and values of files must
//! not command a terminal. This crate depends on no verb and no file format.
//!
//! ```
//! use masseter_terminal::{result_line, status};
//!
//! status!("measuring for {} s", 10);
//! result_line!("{} cycles", 10_000)?;
//! # Ok::<(), anyhow::Error>(())
//! ```

mod colour;
mod exit;
mod stderr_writer;

use std::fmt::Write as _;
use std::io::{self, ErrorKind, Write};

use anyhow::Context;
use clap::ValueEnum;
use rustix::event::{PollFd, PollFlags, Timespec, poll};

pub use colour::{Tone, choose_colour, columns, result_with_tones};
pub use exit::{Exit, Failure, OrFailure, in_one_line};
pub use stderr_writer::{Refusals, StderrWriter};

/// A pipe that takes anything takes as many bytes as one write, bytes.
const PIPE_PART: usize = 4096;
const WRITE_TIMEOUT: Timespec = Timespec { tv_sec: 2, tv_nsec: 0 };

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
    taken(output.write_all(escaped(text).as_bytes()).and_then(|()| output.flush()))
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

/// Writes to standard error in one call, because several processes share it; ignores errors. Text that nobody takes for
/// 2 s is lost: a full pipe must not keep a program from its work or its end.
pub fn warn(text: &str) {
    for part in escaped(text).as_bytes().chunks(PIPE_PART) {
        let is_taken = poll(&mut [PollFd::new(&io::stderr(), PollFlags::OUT)], Some(&WRITE_TIMEOUT));
        if is_taken == Ok(0) {
            return;
        }
        let _ = io::stderr().write_all(part);
    }
}

/// Writes text with control sequences to standard error, for as long as that takes; ignores errors.
pub fn control(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// The text with control characters as their codes, and with those that turn the direction of reading. Line ends and tabs
/// remain.
///
/// ```
/// assert_eq!(masseter_terminal::escaped("jaw\u{1b}[2J\r\n"), "jaw\\u{1b}[2J\\r\n");
/// ```
pub fn escaped(text: &str) -> String {
    let turns = |c| matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if (character.is_control() && !"\n\t".contains(character)) || turns(character) {
            write!(escaped, "{}", character.escape_default()).expect("writing to a string does not fail");
        } else {
            escaped.push(character);
        }
    }
    escaped
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
