//! What is said to whoever started the program. A reader that has had enough, a closed terminal or a full disk behind
//! it is no fault of the run, and never ends one: unlike `println!` and `eprintln!`, nothing here fails.

use std::io::{self, Write};

/// Writes to standard output.
pub(crate) fn show(text: &str) {
    let _ = io::stdout().write_all(text.as_bytes());
}

/// Writes to standard error, in one piece: several processes share it.
pub(crate) fn warn(text: &str) {
    let _ = io::stderr().write_all(text.as_bytes());
}

/// A line of a result, to standard output; as `println!`.
macro_rules! show_line {
    ($($argument:tt)*) => { $crate::say::show(&(format!($($argument)*) + "\n")) };
}

/// A line about what goes on, to standard error; as `eprintln!`.
macro_rules! tell {
    ($($argument:tt)*) => { $crate::say::warn(&(format!($($argument)*) + "\n")) };
}
