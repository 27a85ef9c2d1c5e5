//! `masseter robot`: the bring-up of a robot as a sequence of steps, each with a safe reaction and evidence.
//!
//! A later step refuses without the [evidence](evidence) of the earlier one. The procedures are in
//! [`masseter_commissioning`]: these modules hold arguments, files and text.

mod args;
mod basis;
mod check_pose;
mod configure;
mod evidence;
mod home;
mod inspect;
mod jog;
mod ledger;
mod permission;
mod power_mark;
mod robot_line;
mod session;
mod status;
mod step;
mod watchdog;

use masseter_terminal::{Exit, Failure, OrFailure};

pub(crate) use permission::Played;

/// Verbs of `robot`.
#[derive(Debug, Clone, clap::Subcommand)]
pub(crate) enum RobotVerb {
    /// Read all drives, and show what is not as the scenario needs it
    Inspect(inspect::InspectArgs),
    /// Write the scenario's objects to drives without power
    #[command(after_help = "Example:\n  masseter robot configure robot.toml --can can0,can1 --store")]
    Configure(args::WriteArgs),
    /// Write the values from before configure back
    #[command(after_help = "Example:\n  masseter robot restore robot.toml --can can0,can1 --axis l1")]
    Restore(args::WriteArgs),
    /// Move one axis a short way and back, while the others have no power
    Jog(jog::JogArgs),
    /// Prove that each drive stops by itself once the master is silent
    #[command(after_help = "Examples:\n  masseter robot watchdog\n  masseter robot watchdog --axis l1")]
    Watchdog(args::AxesArgs),
    /// Home the axes, one after the other: the legs first
    #[command(after_help = "Examples:\n  masseter robot home\n  masseter robot home --axis l1")]
    Home(args::AxesArgs),
    /// Check whether the positions of the axes give the closed pose
    CheckPose(check_pose::CheckPoseArgs),
    /// Show which steps are done, and which is next
    Status(status::StatusArgs),
    /// Print the steps and their results as Markdown for a lab book
    #[command(after_help = "Example:\n  masseter robot report robot.toml > lab-book.md")]
    Report(status::StatusArgs),
}

/// Executes a verb.
pub(crate) fn execute(verb: &RobotVerb) -> Result<Exit, Failure> {
    match verb {
        RobotVerb::Inspect(args) => inspect::inspect(args),
        RobotVerb::Configure(args) => configure::configure(args),
        RobotVerb::Restore(args) => configure::restore(args),
        RobotVerb::Jog(args) => jog::jog(args),
        RobotVerb::Watchdog(args) => watchdog::watchdog(args),
        RobotVerb::Home(args) => home::home(args),
        RobotVerb::CheckPose(args) => check_pose::check_pose(args),
        RobotVerb::Status(args) => status::status(args).usage(),
        RobotVerb::Report(args) => status::report(args).usage(),
    }
}
