//! `masseter robot`: the bring-up of a robot as a sequence of steps, each with a safe reaction and evidence.
//!
//! A later step refuses without the [evidence](evidence) of the earlier one. The procedures are in the plant's crate
//! ([`masseter_plant::bringup`]): these modules hold arguments, files and text.

mod args;
mod evidence;
mod past;
mod status;
mod step;

use clap::Subcommand;
use masseter_terminal::{Exit, Failure, OrFailure};

use status::StatusArgs;

/// Verbs of `robot`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum RobotVerb {
    /// Show which steps are done, and which is next
    Status(StatusArgs),
    /// Print the steps and their results as Markdown for a lab book
    #[command(after_help = "Example:\n  masseter robot report robot.toml > lab-book.md")]
    Report(StatusArgs),
}

/// Executes a verb.
pub(crate) fn execute(verb: &RobotVerb) -> Result<Exit, Failure> {
    match verb {
        RobotVerb::Status(args) => status::status(args).usage(),
        RobotVerb::Report(args) => status::report(args).usage(),
    }
}
