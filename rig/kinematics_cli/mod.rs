//! `masseter fk` and `masseter ik`: CSV in, CSV out, one mechanism state a line.
//!
//! Every input line gives one output line, with `fk --all` one for every solution, in order; only comments, lines that
//! begin with `#`, give none. A line that cannot be read, also an empty one, gives one with the status `bad_line`, is
//! explained on standard error, and makes the command exit with 2 at the end.

mod every;
mod forward;
mod input;
mod inverse;
mod table;

pub(crate) use forward::{FkArgs, forward};
pub(crate) use inverse::inverse;
pub(crate) use table::CsvArgs;
