//! The command line: arguments, and which verb they lead to.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};
use masseter_controller::process::Outcome;
use masseter_shared::geometry::AXIS_NAMES;
use masseter_shared::lifecycle::Assignment;

use crate::bench::BenchArgs;
use crate::bench::ipc::PeerArgs;
use crate::can::{PlanArgs, ServeArgs};
use crate::exit::{Exit, Failure, OrFailure};
use crate::log::{self, LogVerb};
use crate::logger::Show;
use crate::study::{self, KinematicsArgs};
use crate::uniqueness::{self, UniquenessVerb};
use crate::{bench, can, clean, csv_kinematics, doctor, live, logger, plant, report, run};

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

/// What `can eds` takes.
#[derive(Debug, Clone, Args)]
pub struct EdsArgs {
    /// Scenario whose drives are meant [default: the published rig]
    pub(crate) scenario: Option<PathBuf>,
    /// Axis of the drive: d1, d2, d3, l1, l2 or l3
    #[arg(long, default_value = "d1", value_parser = parse_axis)]
    pub(crate) axis: usize,
}

/// What `run` takes.
#[derive(Debug, Clone, Default, Args)]
pub struct RunArgs {
    /// Scenario file; without one, ten seconds of chewing
    pub scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV) to play instead of the scenario's motion
    #[arg(long, value_name = "FILE.csv")]
    pub trajectory: Option<PathBuf>,
    /// How long the motion lasts, such as 10s or 2min
    #[arg(long, value_parser = humantime::parse_duration)]
    pub duration: Option<Duration>,
    /// Cycles per second
    #[arg(long)]
    pub rate_hz: Option<u32>,
    /// Real time in three processes, or virtual time in one thread
    #[arg(long, value_enum, default_value_t)]
    pub clock: ClockKind,
    /// Simulated buses, or the real interface of each, such as can0,can1
    #[arg(long, value_name = "virtual|IF[,IF]", value_parser = parse_wires)]
    pub can: Option<Wires>,
    /// Cores of controller and plant
    #[arg(long, value_name = "N,N", value_parser = parse_cores)]
    pub cores: Option<[usize; 2]>,
    /// Seed of every random number
    #[arg(long)]
    pub seed: Option<u64>,
    /// The run folder; must not exist [default: runs/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Name of this rig, which no other running one may have [default: one that none has]
    #[arg(long)]
    pub name: Option<String>,
    /// How the result is written to standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Exit with 3 unless core, SCHED_FIFO, locked memory and, where it is to be held, /dev/cpu_dma_latency are granted
    #[arg(long)]
    pub require_rt: bool,
    /// Show the run live to Foxglove over a WebSocket, to this machine only unless an address is given
    #[arg(
        long,
        value_name = "ADDR:PORT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = live::DEFAULT_ADDRESS
    )]
    pub live: Option<SocketAddr>,
    /// Show no progress
    #[arg(long)]
    pub quiet: bool,
}

/// What the buses run on: real interfaces, or none for simulated buses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Wires(pub Vec<String>);

/// What `plant` takes.
#[derive(Debug, Clone, Args)]
pub(crate) struct PlantArgs {
    /// Scenario file with the drives and the mechanism; without one, the published mechanism
    #[arg(value_name = "SCENARIO")]
    pub(crate) file: Option<PathBuf>,
    /// The real interface of each bus, such as can0,can1
    #[arg(long, value_name = "IF[,IF]", value_parser = parse_wires)]
    pub(crate) can: Option<Wires>,
    /// Put the emulated drives on the interfaces, until Ctrl-C
    #[arg(long)]
    pub(crate) emulate: bool,
    #[arg(long, hide = true, requires = "domain")]
    scenario: Option<PathBuf>,
    #[arg(long, hide = true, requires = "scenario")]
    domain: Option<String>,
}

impl PlantArgs {
    /// What the supervisor started the plant with, if it was the supervisor.
    pub(crate) fn assignment(&self) -> Option<Assignment> {
        Some(Assignment { scenario: self.scenario.clone()?, domain: self.domain.clone()? })
    }
}

/// Which time a run lives in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum ClockKind {
    /// Real time.
    #[default]
    Rt,
    /// Virtual time: as fast as it goes, the same bytes every time.
    Virtual,
}

/// How results are written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people.
    #[default]
    Human,
    /// For programs.
    Json,
}

/// CSV in, CSV out.
#[derive(Debug, Clone, Args)]
pub struct CsvArgs {
    /// CSV file to read [default: standard input]
    #[arg(long, value_name = "FILE.csv")]
    pub input: Option<PathBuf>,
    /// Scenario whose mechanism is meant [default: the published one]
    #[arg(long, value_name = "SCENARIO.toml")]
    pub scenario: Option<PathBuf>,
}

/// What `fk` takes.
#[derive(Debug, Clone, Args)]
pub struct FkArgs {
    #[command(flatten)]
    pub(crate) csv: CsvArgs,
    /// Which iteration: the controller's certified one, the paper's, or Newton-Raphson
    #[arg(long, value_enum, default_value_t)]
    pub(crate) solver: Solver,
    /// Leg angles to start every line from, with --continuous the first, radians [default: the paper's neutral pose,
    /// 1.46 each; the controller's solver needs none]
    #[arg(long, value_name = "RAD,RAD,RAD", value_parser = parse_guess, allow_hyphen_values = true)]
    pub(crate) guess: Option<[f64; 3]>,
    /// Start each line from the solution of the one before; takes one core only
    #[arg(long)]
    pub(crate) continuous: bool,
    /// Every solution of every line, a line each, with the conditions it meets
    #[arg(long, conflicts_with_all = ["solver", "guess", "continuous"])]
    pub(crate) all: bool,
}

/// Which forward solver.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Solver {
    /// The certified one of the control loop: the true solution, or the reason why there is none.
    #[default]
    Controller,
    /// The paper's: some solution, from the guess.
    Published,
    /// Newton-Raphson: some solution, from the guess.
    Newton,
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

pub(crate) fn parse_cores(text: &str) -> Result<[usize; 2], String> {
    let cores: Result<Vec<usize>, _> = text.split(',').map(|core| core.trim().parse()).collect();
    match cores.as_deref() {
        Ok([controller, plant]) => Ok([*controller, *plant]),
        _ => Err("give two cores, such as 0,1".to_owned()),
    }
}

fn parse_wires(text: &str) -> Result<Wires, String> {
    if text == "virtual" {
        return Ok(Wires(Vec::new()));
    }
    let names: Vec<_> = text.split(',').map(|name| name.trim().to_owned()).collect();
    if names.iter().any(String::is_empty) {
        return Err("give `virtual`, or interfaces such as can0,can1".to_owned());
    }
    Ok(Wires(names))
}

fn parse_axis(text: &str) -> Result<usize, String> {
    let axis = AXIS_NAMES.iter().position(|name| *name == text);
    axis.ok_or_else(|| format!("the axes are {}", AXIS_NAMES.join(" ")))
}

fn parse_guess(text: &str) -> Result<[f64; 3], String> {
    let angles: Result<Vec<f64>, _> = text.split(',').map(|angle| angle.trim().parse()).collect();
    match angles.as_deref() {
        Ok(&[t1, t2, t3]) if t1.is_finite() && t2.is_finite() && t3.is_finite() => Ok([t1, t2, t3]),
        _ => Err("give three leg angles in radians, such as 1.4,1.5,1.4".to_owned()),
    }
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
            tell!("masseter: {}", in_one_line(&error));
            exit.into()
        }
    }
}

/// What goes wrong in most verbs is for the user to mend; the others say themselves what it leads to.
fn carry_out(verb: Verb) -> Result<Exit, Failure> {
    match verb {
        Verb::Run(args) => run::run(&args),
        Verb::Report(ReportArgs { folder, against: None, format }) => report::again(&folder, format),
        Verb::Report(ReportArgs { folder, against: Some(against), format }) => {
            report::compare::runs(&folder, &against, format).usage()
        }
        Verb::Bench(args) => bench::run(&args),
        Verb::BenchPeer(args) => bench::ipc::answer(&args).map(|()| Exit::Passed).usage(),
        Verb::Fk(args) => csv_kinematics::forward(&args).usage(),
        Verb::Ik(args) => csv_kinematics::inverse(&args).usage(),
        Verb::Can(CanVerb::Plan(args)) => can::plan(&args).usage(),
        Verb::Can(CanVerb::Eds(args)) => can::eds(&args).usage(),
        Verb::Can(CanVerb::Dbc { scenario }) => can::dbc(scenario.as_deref()).usage(),
        Verb::Can(CanVerb::Serve(args)) => can::serve(&args).usage(),
        Verb::Uniqueness(verb) => uniqueness::uniqueness(&verb).usage(),
        Verb::Kinematics(args) => study::kinematics(&args).usage(),
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
