//! A run: planned, played, judged.
//!
//! [`masseter_plan`] refuses a scenario that cannot run before anything starts. Then [`supervisor`] runs the three
//! processes, or [`masseter_virtual_time`] steps their cores. Analysis and report judge the recording. [`runner`] plays
//! the runs of all verbs that play many.

mod child;
mod controller;
mod declaration;
pub(crate) mod interrupts;
mod loop_watch;
mod prepared;
mod program;
mod reception;
pub(crate) mod request;
mod resolve;
mod room;
pub(crate) mod runner;
mod strikes;
mod supervisor;
mod usage;

pub(crate) use declaration::declared_by;
pub(crate) use prepared::PreparedRun;
pub(crate) use program::{end_with_parent, exec_program};
pub(crate) use resolve::{needs_processes, resolve_simulated};
