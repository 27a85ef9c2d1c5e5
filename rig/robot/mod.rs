//! `masseter robot`: the bring-up of a robot as a sequence of steps, each with a safe reaction and evidence.
//!
//! A later step refuses without the [evidence](evidence) of the earlier one. The procedures are in the plant's crate
//! ([`masseter_plant::bringup`]): these modules hold arguments, files and text.

mod args;
mod before;
mod check_pose;
mod configure;
mod damaged;
mod dry_run;
mod evidence;
mod hold;
mod home;
mod identity;
mod inspect;
mod interfaces;
mod jog;
mod ledger;
mod lengths;
mod past;
mod permission;
mod power_mark;
mod presence;
mod restore;
mod robot_line;
mod session;
mod snapshot;
mod status;
mod step;
mod table;
mod writing;

use clap::Subcommand;
use masseter_terminal::{Exit, Failure, OrFailure};

use args::WriteArgs;
use check_pose::CheckPoseArgs;
use home::HomeArgs;
use inspect::InspectArgs;
use jog::JogArgs;
use status::StatusArgs;

pub(crate) use dry_run::{Played, keep_dry_run};
pub(crate) use permission::check_bring_up;

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
    /// Move one axis a short way and back, while the others have no power
    Jog(JogArgs),
    /// Home the axes, one after the other
    Home(HomeArgs),
    /// Check whether the axes tell the closed pose
    CheckPose(CheckPoseArgs),
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
        RobotVerb::Jog(args) => jog::jog(args),
        RobotVerb::Home(args) => home::home(args),
        RobotVerb::CheckPose(args) => check_pose::check_pose(args),
        RobotVerb::Status(args) => status::status(args).usage(),
        RobotVerb::Report(args) => status::report(args).usage(),
    }
}
