//! The command line: the verbs, and where each is carried out. What a verb takes stands beside what it does.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Args, Parser, Subcommand};
use masseter_controller::process::Outcome;
use masseter_shared::lifecycle::Assignment;

use crate::bench::args::BenchArgs;
use crate::bench::ipc::PeerArgs;
use crate::can::{EdsArgs, PlanArgs, ServeArgs};
use crate::csv_kinematics::{self, CsvArgs, FkArgs};
use crate::log::{self, LogVerb};
use crate::logger::Show;
use crate::plant::{self, PlantArgs};
use crate::run::{self, args::RunArgs};
use crate::{bench, can, clean, doctor, logger};
use masseter_study::KinematicsArgs;
use masseter_study::uniqueness::UniquenessVerb;
use masseter_terminal::{Exit, Failure, Format, OrFailure, status};

/// A hardware-in-the-loop rig for a 6-DOF mastication robot.
#[derive(Debug, Parser)]
#[command(name = "masseter", version, max_term_width = 100)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Play a jaw motion through controller, plant and logger
    Run(RunArgs),
    /// Forward kinematics: actuator columns to poses, CSV to CSV
    Fk(FkArgs),
    /// Inverse kinematics: poses to actuator and hinge columns, CSV to CSV
    Ik(CsvArgs),
    /// Emulate the six drives and their mechanism on real CAN interfaces, for a master elsewhere
    Plant(PlantArgs),
    /// The report of a run folder, again; or two runs side by side
    Report(ReportArgs),
    /// Is this machine fit for real-time runs?
    Doctor(DoctorArgs),
    /// Look at recordings, prove them complete, repair and convert them
    Log {
        #[command(subcommand)]
        verb: LogVerb,
    },
    /// The CAN link: its plan, and descriptions of the drives for other tools
    #[command(subcommand)]
    Can(CanVerb),
    /// What the rig's parts cost, each beside a baseline in the same run
    Bench(BenchArgs),
    /// How far an input settles the pose: a proof for regions of inputs, and a search for exceptions
    #[command(subcommand)]
    Uniqueness(UniquenessVerb),
    /// The paper's study of the forward kinematics again: figures, data and a page of its claims
    Kinematics(KinematicsArgs),
    /// Remove what killed runs left in shared memory
    Clean,
    #[command(hide = true)]
    BenchPeer(PeerArgs),
    #[command(hide = true)]
    Controller(ProcessArgs),
    #[command(hide = true)]
    Logger(LoggerArgs),
}

/// Verbs of `can`.
#[derive(Debug, Subcommand)]
enum CanVerb {
    /// Worst-case load and response time of every message against the cycle
    Plan(PlanArgs),
    /// The electronic data sheet (EDS, CiA 306) of a drive
    Eds(EdsArgs),
    /// The messages of the link as a DBC file
    Dbc {
        /// Scenario whose drives are meant [default: the published rig]
        scenario: Option<PathBuf>,
    },
    /// Let third-party tools onto the simulated buses with the emulated drives (socketcand protocol)
    Serve(ServeArgs),
}

/// What `report` takes.
#[derive(Debug, Clone, Args)]
struct ReportArgs {
    /// Run folder
    #[arg(default_value = "runs/latest")]
    folder: PathBuf,
    /// Another run folder, to set beside the first
    against: Option<PathBuf>,
    /// How the result is written to standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// What `doctor` takes.
#[derive(Debug, Clone, Args)]
struct DoctorArgs {
    /// How the report is written to standard output
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

#[derive(Debug, Clone, Args)]
struct ProcessArgs {
    #[arg(long)]
    scenario: PathBuf,
    #[arg(long)]
    domain: String,
}

impl ProcessArgs {
    fn assignment(self) -> Assignment {
        Assignment { scenario: self.scenario, domain: self.domain }
    }
}

#[derive(Debug, Clone, Args)]
struct LoggerArgs {
    #[command(flatten)]
    process: ProcessArgs,
    #[arg(long)]
    recording: PathBuf,
    #[arg(long)]
    live: Option<SocketAddr>,
    #[arg(long)]
    motion_s: Option<f64>,
    #[arg(long)]
    quiet: bool,
}

/// An error and what caused it; an error that quotes its cause is not followed by it again.
fn in_one_line(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |said, cause| {
        let cause = cause.to_string();
        match said.as_str() {
            "" => cause,
            _ if said.contains(&cause) => said,
            _ => said + ": " + &cause,
        }
    })
}

/// Parses the arguments, carries the verb out, and reports what went wrong.
pub fn main() -> ExitCode {
    match carry_out(Cli::parse().verb) {
        Ok(exit) => exit.into(),
        Err(Failure { exit, error }) => {
            status!("masseter: {}", in_one_line(&error));
            exit.into()
        }
    }
}

/// What goes wrong in most verbs is for the user to mend; the others say themselves what it leads to.
fn carry_out(verb: Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Run(args) => run::run(&args),
        Verb::Report(ReportArgs { folder, against: None, format }) => masseter_report::again(&folder, format),
        Verb::Report(ReportArgs { folder, against: Some(against), format }) => {
            masseter_report::compare::runs(&folder, &against, format).usage()
        }
        Verb::Bench(args) => bench::run(&args),
        Verb::BenchPeer(args) => bench::ipc::answer(&args).map(|()| Exit::Passed).usage(),
        Verb::Fk(args) => csv_kinematics::forward(&args).usage(),
        Verb::Ik(args) => csv_kinematics::inverse(&args).usage(),
        Verb::Can(CanVerb::Plan(args)) => can::plan(&args).usage(),
        Verb::Can(CanVerb::Eds(args)) => can::eds(&args).usage(),
        Verb::Can(CanVerb::Dbc { scenario }) => can::dbc(scenario.as_deref()).usage(),
        Verb::Can(CanVerb::Serve(args)) => can::serve(&args).usage(),
        Verb::Uniqueness(verb) => masseter_study::uniqueness::uniqueness(&verb).usage(),
        Verb::Kinematics(args) => masseter_study::kinematics(&args).usage(),
        Verb::Doctor(args) => doctor::examine(args.format).usage(),
        Verb::Log { verb } => log::run(&verb).usage(),
        Verb::Clean => clean::clean().usage(),
        Verb::Controller(args) => control(args).usage(),
        Verb::Plant(args) => plant::plant(&args).usage(),
        Verb::Logger(args) => log_run(args).usage(),
    }
}

fn control(args: ProcessArgs) -> anyhow::Result<Exit> {
    Ok(match masseter_controller::process::run(&args.assignment())? {
        Outcome::Finished => Exit::Passed,
        Outcome::SafeStop => Exit::SafeStop,
    })
}

fn log_run(args: LoggerArgs) -> anyhow::Result<Exit> {
    let LoggerArgs { process, recording, live, motion_s, quiet } = args;
    let show = Show { live, quiet, motion_s };
    logger::run(&process.assignment(), &recording, show)
}
