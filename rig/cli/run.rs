//! `masseter run`: its arguments, from which a [`RunRequest`] is made, played and reported.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use masseter_plan::Overrides;
use masseter_recorder::live;
use masseter_report::Detail;
use masseter_runtime::lifecycle::Patience;
use masseter_terminal::{Exit, Failure, Format};
use rustix::fs::Mode;

use super::arguments::{
    Wires, parse_address, parse_controller, parse_cores, parse_duration, parse_patience, parse_wires,
};
use crate::run::PreparedRun;
use crate::run::interrupts::Interrupts;
use crate::run::request::{ClockKind, ControllerChoice, RunRequest};

const WHAT: &str = "Choose what to play";
const HOW: &str = "Choose how it runs";
const WATCH: &str = "Watch the run";
const KEEP: &str = "Keep the result";

/// The arguments of `run`.
#[derive(Debug, Clone, Args)]
#[command(
    after_help = "Examples:\n  masseter run --duration 30\n  masseter run scenario.toml --live\n  masseter run --clock virtual --seed 2 --out /tmp/run"
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(super) struct RunArgs {
    /// Scenario file [default: ten seconds of chewing]
    scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV), instead of the scenario's motion
    #[arg(long, value_name = "FILE.csv", help_heading = WHAT)]
    trajectory: Option<PathBuf>,
    /// Duration of the motion in seconds, or with a unit, such as 10, 10s or 2min
    #[arg(long, value_name = "TIME", value_parser = parse_duration, allow_negative_numbers = true, help_heading = WHAT)]
    duration: Option<Duration>,
    /// Change a key of the scenario, such as controller.integral_gain_per_s=50; may be given several times
    #[arg(long, value_name = "KEY=VALUE", help_heading = WHAT)]
    set: Vec<String>,
    /// Cycles per second
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help_heading = HOW)]
    rate_hz: Option<u32>,
    /// Clock of the run
    #[arg(long, value_enum, default_value_t, help_heading = HOW)]
    clock: ClockKind,
    /// In lockstep, how long a process may take to answer before the run ends: such as 10s, or none for a debugger
    /// [default: 10s]
    #[arg(long, value_name = "TIME", value_parser = parse_patience, help_heading = HOW)]
    patience: Option<Patience>,
    /// Who controls the robot: motion plays the motion, hold keeps the position found at the start, a path starts
    /// your own program, external waits until you start it [default: motion]
    #[arg(
        long,
        value_name = "motion|hold|external|none|PATH",
        value_parser = parse_controller,
        default_value = "motion",
        hide_default_value = true,
        help_heading = WHAT
    )]
    controller: ControllerChoice,
    /// Simulated buses, or the CAN interface of each bus, such as can0,can1
    #[arg(long, value_name = "virtual|IF[,IF]", value_parser = parse_wires, help_heading = HOW)]
    can: Option<Wires>,
    /// Move a robot without a passed 'masseter robot check-pose': a wrong sign, scale or zero can drive an axis into
    /// its end
    #[arg(long, help_heading = HOW)]
    without_bring_up: bool,
    /// Play the motion at a tenth of its speed with little force, and predict what it demands at full speed
    #[arg(long, help_heading = HOW)]
    dry: bool,
    /// Reset the fault of a drive that is in fault at the start, instead of ending the run
    #[arg(long, help_heading = HOW)]
    reset_faults: bool,
    /// How long to wait for a drive that is not ready, such as one with safe torque off [default: 5s]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = HOW)]
    wait_ready: Option<Duration>,
    /// Cores of controller and plant
    #[arg(long, value_name = "N,N", value_parser = parse_cores, help_heading = HOW)]
    cores: Option<[usize; 2]>,
    /// Seed of every random number
    #[arg(long, allow_negative_numbers = true, help_heading = HOW)]
    seed: Option<u64>,
    /// Run folder; must not exist [default: runs/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR", help_heading = KEEP)]
    out: Option<PathBuf>,
    /// Name of this rig, unique among running rigs [default: a generated one]
    #[arg(long, help_heading = HOW)]
    name: Option<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t, help_heading = WATCH)]
    format: Format,
    /// Exit with 3 unless the kernel grants cores, SCHED_FIFO, locked memory and, if requested, /dev/cpu_dma_latency
    #[arg(long, help_heading = HOW)]
    require_rt: bool,
    /// Show the run live in a browser and in Foxglove on a port of this machine, such as --live=9000, or on an address
    /// [default: 127.0.0.1:8765]
    #[arg(
        long,
        value_name = "PORT|ADDR:PORT",
        value_parser = parse_address,
        help_heading = WATCH,
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = live::DEFAULT_ADDRESS
    )]
    live: Option<SocketAddr>,
    /// Who may read the run's files
    #[arg(long, value_enum, default_value_t, value_name = "WHO", help_heading = KEEP)]
    pub(super) readable_by: Readers,
    /// Show every figure, not only verdict and checks
    #[arg(long, help_heading = WATCH)]
    verbose: bool,
    /// Show no progress
    #[arg(long, help_heading = WATCH)]
    quiet: bool,
}

impl RunArgs {
    fn into_request(self) -> RunRequest {
        let overrides = Overrides {
            set: self.set,
            trajectory: self.trajectory,
            duration: self.duration,
            rate_hz: self.rate_hz,
            interfaces: self.can.map(|wires| wires.0),
            cores: self.cores,
            seed: self.seed,
            is_dry: self.dry,
            reset_faults: self.reset_faults,
            wait_ready: self.wait_ready,
        };
        RunRequest {
            scenario: self.scenario,
            overrides,
            clock: self.clock,
            patience: self.patience,
            controller: self.controller,
            without_bring_up: self.without_bring_up,
            out: self.out,
            name: self.name,
            require_rt: self.require_rt,
            live: self.live,
            quiet: self.quiet,
        }
    }
}

/// Plays the motion, judges the run, and writes its folder.
pub(super) fn run(args: RunArgs) -> Result<Exit, Failure> {
    let (format, detail) = (args.format, if args.verbose { Detail::Whole } else { Detail::Brief });
    let prepared = PreparedRun::new(&args.into_request())?;
    let interrupts = Interrupts::of_verb()?;
    let played = prepared.play(&interrupts);
    interrupts.restore_default_actions();
    played?.report(format, detail)
}

/// Who may read the files of a run. They hold the motion of a person's jaw.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Readers {
    /// This user
    #[default]
    Owner,
    /// This user and the group
    Group,
    /// Every user of the machine
    All,
}

impl Readers {
    /// The rights that new files do not get.
    pub(super) fn umask(self) -> Mode {
        match self {
            Self::Owner => Mode::RWXG | Mode::RWXO,
            Self::Group => Mode::WGRP | Mode::RWXO,
            Self::All => Mode::WGRP | Mode::WOTH,
        }
    }
}
