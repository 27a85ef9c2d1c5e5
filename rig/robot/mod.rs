//! `masseter robot`: the bring-up of a robot as a sequence of steps, each with a safe reaction and evidence.
//!
//! A later step refuses without the [evidence](evidence) of the earlier one. The procedures are in the plant's crate
//! ([`masseter_plant::bringup`]): these modules hold arguments, files and text.

mod args;
mod configure;
mod evidence;
mod inspect;
mod interfaces;
mod past;
mod restore;
mod robot_line;
mod snapshot;
mod status;
mod step;
mod table;
mod writing;

use clap::Subcommand;
use masseter_terminal::{Exit, Failure, OrFailure};

use configure::WriteArgs;
use inspect::InspectArgs;
use status::StatusArgs;

/// Verbs of `robot`.
#[derive(Debug, Clone, Subcommand)]
pub(crate) enum RobotVerb {
    /// Read all drives, and show what is not as the scenario needs it
    Inspect(InspectArgs),
    /// Write the scenario's objects to drives without power
    #[command(after_help = "Example:\n  masseter robot configure robot.toml --can can0,can1 --store")]
    Configure(WriteArgs),
    /// Write the values from before configure back
    #[command(after_help = "Example:\n  masseter robot restore robot.toml --can can0,can1 --axis l1")]
    Restore(WriteArgs),
    /// Show which steps are done, and which is next
    Status(StatusArgs),
    /// Print the steps and their results as Markdown for a lab book
    #[command(after_help = "Example:\n  masseter robot report robot.toml > lab-book.md")]
    Report(StatusArgs),
}

/// Executes a verb.
pub(crate) fn execute(verb: &RobotVerb) -> Result<Exit, Failure> {
    match verb {
        RobotVerb::Inspect(args) => inspect::inspect(args),
        RobotVerb::Configure(args) => configure::configure(args),
        RobotVerb::Restore(args) => restore::restore(args),
        RobotVerb::Status(args) => status::status(args).usage(),
        RobotVerb::Report(args) => status::report(args).usage(),
    }
}
