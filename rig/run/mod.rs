//! `masseter run`: from arguments to a verdict.
//!
//! [`masseter_plan`] refuses a scenario that cannot run before anything starts. Then [`supervisor`] runs the three
//! processes, or [`masseter_virtual_time`] steps their cores. Analysis and report judge the recording. `masseter test` plays its
//! scenarios by [`PreparedRun`], or without a recording by [`judge_unrecorded`].

pub(crate) mod args;
mod child;
mod clock;
mod controller;
mod ending;
pub(crate) mod exec_program;
mod prepared;
mod program;
mod reception;
mod reports;
mod resolve;
mod room;
mod strikes;
mod supervisor;
mod usage;

use anyhow::Context;
use masseter_terminal::{Exit, Failure, OrFailure};

use crate::interrupts::Interrupts;
use args::RunArgs;

pub(crate) use clock::needs_processes;
#[cfg(test)]
pub(crate) use prepared::figures_by;
pub(crate) use prepared::{PreparedRun, figures_unrecorded, judge_unrecorded};
pub(crate) use resolve::check_simulated;

/// Plays the motion, judges the run, and writes its folder.
pub(crate) fn run(args: &RunArgs) -> Result<Exit, Failure> {
    let prepared = PreparedRun::new(args)?;
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report()
}
