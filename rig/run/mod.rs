//! `masseter run`: from arguments to a verdict.
//!
//! [`masseter_plan`] refuses a scenario that cannot run before anything starts. Then [`supervisor`] runs the three
//! processes, or [`virtual_time`] steps their cores. Analysis and report judge the recording. `masseter test` plays its
//! scenarios by [`PreparedRun`], or without a recording by [`judge_unrecorded`].

pub(crate) mod args;
mod child;
mod clock;
mod controller;
mod ending;
pub(crate) mod exec_program;
mod log;
mod logged_ports;
mod prepared;
mod program;
mod reception;
mod reports;
mod resolve;
mod room;
mod sink;
mod strikes;
mod supervisor;
mod usage;
mod virtual_time;

use anyhow::Context;
use masseter_terminal::{Exit, Failure, OrFailure};

use crate::machine::interrupts::Interrupts;
use args::RunArgs;

pub(crate) use clock::needs_processes;
pub(crate) use log::Log;
pub(crate) use logged_ports::LoggedPorts;
#[cfg(test)]
pub(crate) use prepared::figures_by;
pub(crate) use prepared::{PreparedRun, figures_unrecorded, judge_unrecorded, shown_figures};
pub(crate) use resolve::check_simulated;
pub(crate) use sink::Sink;

/// Plays the motion, judges the run, and writes its folder.
pub(crate) fn run(args: &RunArgs) -> Result<Exit, Failure> {
    let prepared = PreparedRun::new(args)?;
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report()
}
