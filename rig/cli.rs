//! The command line: dispatches each verb to its module, and prints errors. Arguments are defined beside their verbs.

use std::process::ExitCode;
use std::sync::Arc;

use clap::{Parser, Subcommand};
use masseter_terminal::{Exit, Failure, OrFailure, status};

use crate::bench::ipc::PeerArgs;
use crate::bench::{self, args::BenchArgs};
use crate::can::{self, CanVerb};
use crate::clean;
use crate::controller::{self, ControllerArgs};
use crate::csv_kinematics::{self, CsvArgs, FkArgs};
use crate::doctor::{self, DoctorArgs};
use crate::kinematics::{self, KinematicsArgs};
use crate::plant::{self, PlantArgs};
use crate::recorder::{self, RecorderArgs};
use crate::recording_cli::{self, RecordingVerb};
use crate::report_cli::{self, ReportArgs};
use crate::run::{self, args::RunArgs};
use crate::uniqueness::{self, UniquenessVerb};

/// A hardware-in-the-loop rig for a 6-DOF mastication robot
///
/// Exit codes of every verb: 0 passed, 1 a check failed, 2 wrong usage or input, 3 cannot be judged, 4 a process died,
/// 5 unexpected safe stop, 6 files incomplete, 130 interrupted.
#[derive(Debug, Parser)]
#[command(
    name = "masseter",
    version,
    max_term_width = 100,
    after_help = "Start with `masseter doctor`, then `masseter run`."
)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Run a jaw motion through controller, plant and recorder, and judge it
    Run(RunArgs),
    /// Forward kinematics of a CSV file: actuator positions to poses
    Fk(FkArgs),
    /// Inverse kinematics of a CSV file: poses to actuator positions and hinge angles
    Ik(CsvArgs),
    /// Emulate the six drives and the mechanism on real CAN interfaces
    Plant(PlantArgs),
    /// Write the report of a run again, or compare two runs
    Report(ReportArgs),
    /// Check whether this machine is fit for real-time runs
    Doctor(DoctorArgs),
    /// Inspect, verify, recover and export recordings
    #[command(subcommand, alias = "log")]
    Recording(RecordingVerb),
    /// Plan the CAN buses, describe the drives (EDS, DBC), serve the simulated buses
    #[command(subcommand)]
    Can(CanVerb),
    /// Measure parts of the rig, each beside a baseline
    Bench(BenchArgs),
    /// Prove where the six inputs determine one pose, or search for exceptions
    #[command(subcommand)]
    Uniqueness(UniquenessVerb),
    /// Reproduce the paper's study of the forward kinematics: figures, data, claims
    #[command(visible_alias = "paper")]
    Kinematics(KinematicsArgs),
    /// Remove what killed runs left in shared memory
    Clean,
    #[command(hide = true)]
    BenchPeer(PeerArgs),
    #[command(hide = true)]
    Controller(ControllerArgs),
    #[command(hide = true)]
    Recorder(RecorderArgs),
}

/// Parses the arguments, executes the verb, and prints its error.
pub fn main() -> ExitCode {
    // A write beyond the limit on the size of files is then an error, not the end.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
    match execute(Cli::parse().verb) {
        Ok(exit) => exit.into(),
        Err(Failure { exit, error }) => {
            status!("masseter: {}", in_one_line(&error));
            exit.into()
        }
    }
}

/// Errors lead to exit code 2 unless the verb itself chooses another.
fn execute(verb: Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Run(args) => run::run(&args),
        Verb::Report(args) => report_cli::report(&args),
        Verb::Bench(args) => bench::run(&args),
        Verb::BenchPeer(args) => bench::ipc::answer(&args).map(|()| Exit::Passed).usage(),
        Verb::Fk(args) => csv_kinematics::forward(&args).usage(),
        Verb::Ik(args) => csv_kinematics::inverse(&args).usage(),
        Verb::Can(verb) => can::execute(&verb).usage(),
        Verb::Uniqueness(verb) => uniqueness::uniqueness(&verb).usage(),
        Verb::Kinematics(args) => kinematics::kinematics(&args).usage(),
        Verb::Doctor(args) => doctor::examine(&args).usage(),
        Verb::Recording(verb) => recording_cli::execute(&verb).usage(),
        Verb::Clean => clean::clean().usage(),
        Verb::Controller(args) => controller::control(args).usage(),
        Verb::Plant(args) => plant::plant(&args).usage(),
        Verb::Recorder(args) => recorder::record(args).usage(),
    }
}

/// An error and its causes in one line, without causes that the text before quotes.
fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |text, cause| {
        let cause = cause.to_string();
        match text.as_str() {
            "" => cause,
            _ if text.contains(&cause) => text,
            _ => text + ": " + &cause,
        }
    })
}
