//! The arguments of `masseter run`.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};
use masseter_plan::Overrides;
use masseter_report::Detail;
use masseter_runtime::lifecycle::Patience;
use masseter_terminal::Format;
use rustix::fs::Mode;

use crate::arguments::{
    ControllerChoice, Wires, parse_address, parse_controller, parse_cores, parse_duration, parse_patience,
    parse_wires,
};
use masseter_recorder::live;

const WHAT: &str = "Choose what to play";
const HOW: &str = "Choose how it runs";
const WATCH: &str = "Watch the run";
const KEEP: &str = "Keep the result";

/// The patience of a run in lockstep.
const DEFAULT_PATIENCE: Duration = Duration::from_secs(10);

/// The arguments of `run`.
#[derive(Debug, Clone, Default, Args)]
#[command(
    after_help = "Examples:\n  masseter run --duration 30\n  masseter run scenario.toml --live\n  masseter run --clock virtual --seed 2 --out /tmp/run"
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(crate) struct RunArgs {
    /// Scenario file [default: ten seconds of chewing]
    pub scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV), instead of the scenario's motion
    #[arg(long, value_name = "FILE.csv", help_heading = WHAT)]
    pub trajectory: Option<PathBuf>,
    /// Duration of the motion in seconds, or with a unit, such as 10, 10s or 2min
    #[arg(long, value_name = "TIME", value_parser = parse_duration, allow_negative_numbers = true, help_heading = WHAT)]
    pub duration: Option<Duration>,
    /// Change a key of the scenario, such as controller.integral_gain_per_s=50; may be given several times
    #[arg(long, value_name = "KEY=VALUE", help_heading = WHAT)]
    pub set: Vec<String>,
    /// Cycles per second
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help_heading = HOW)]
    pub rate_hz: Option<u32>,
    /// Clock of the run
    #[arg(long, value_enum, default_value_t, help_heading = HOW)]
    pub clock: ClockKind,
    /// In lockstep, how long a process may take to answer before the run ends: such as 10s, or none for a debugger
    /// [default: 10s]
    #[arg(long, value_name = "TIME", value_parser = parse_patience, help_heading = HOW)]
    pub patience: Option<Patience>,
    /// Who controls the robot: motion plays the motion, hold keeps the position found at the start, a path starts your own
    /// program, external waits until you start it [default: motion]
    #[arg(
        long,
        value_name = "motion|hold|external|none|PATH",
        value_parser = parse_controller,
        default_value = "motion",
        hide_default_value = true,
        help_heading = WHAT
    )]
    pub controller: ControllerChoice,
    /// Simulated buses, or the CAN interface of each bus, such as can0,can1
    #[arg(long, value_name = "virtual|IF[,IF]", value_parser = parse_wires, help_heading = HOW)]
    pub can: Option<Wires>,
    /// Move a robot without a passed 'masseter robot check-pose': a wrong sign, scale or zero can drive an axis into its end
    #[arg(long, help_heading = HOW)]
    pub without_bring_up: bool,
    #[command(flatten)]
    pub start: StartArgs,
    /// Cores of controller and plant
    #[arg(long, value_name = "N,N", value_parser = parse_cores, help_heading = HOW)]
    pub cores: Option<[usize; 2]>,
    /// Seed of every random number
    #[arg(long, allow_negative_numbers = true, help_heading = HOW)]
    pub seed: Option<u64>,
    /// Run folder; must not exist [default: runs/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR", help_heading = KEEP)]
    pub out: Option<PathBuf>,
    /// Name of this rig, unique among running rigs [default: a generated one]
    #[arg(long, help_heading = HOW)]
    pub name: Option<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t, help_heading = WATCH)]
    pub format: Format,
    /// Exit with 3 unless the kernel grants cores, SCHED_FIFO, locked memory and, if requested, /dev/cpu_dma_latency
    #[arg(long, help_heading = HOW)]
    pub require_rt: bool,
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
    pub live: Option<SocketAddr>,
    /// Who may read the run's files
    #[arg(long, value_enum, default_value_t, value_name = "WHO", help_heading = KEEP)]
    pub readable_by: Readers,
    /// Show every figure, not only verdict and checks
    #[arg(long, help_heading = WATCH)]
    pub verbose: bool,
    /// Show no progress
    #[arg(long, help_heading = WATCH)]
    pub quiet: bool,
}

/// How carefully the run starts.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct StartArgs {
    /// Play the motion at a tenth of its speed with little force, and predict what it demands at full speed
    #[arg(long, help_heading = HOW)]
    pub dry: bool,
    /// Reset the fault of a drive that is in fault at the start, instead of ending the run
    #[arg(long, help_heading = HOW)]
    pub reset_faults: bool,
    /// How long to wait for a drive that is not ready, such as one with safe torque off [default: 5s]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = HOW)]
    pub wait_ready: Option<Duration>,
}

impl RunArgs {
    /// How much of the report standard output gets.
    pub(super) fn detail(&self) -> Detail {
        if self.verbose { Detail::Whole } else { Detail::Brief }
    }

    /// For how long a process may be silent in lockstep.
    pub(super) fn lockstep(&self) -> Option<Patience> {
        let patience = self.patience.unwrap_or(Patience(Some(DEFAULT_PATIENCE)));
        (self.clock == ClockKind::Lockstep).then_some(patience)
    }

    /// The changes to the scenario.
    pub(super) fn overrides(&self) -> Overrides {
        Overrides {
            set: self.set.clone(),
            trajectory: self.trajectory.clone(),
            duration: self.duration,
            rate_hz: self.rate_hz,
            interfaces: self.can.as_ref().map(|wires| wires.0.clone()),
            cores: self.cores,
            seed: self.seed,
            is_dry: self.start.dry,
            reset_faults: self.start.reset_faults,
            wait_ready: self.start.wait_ready,
        }
    }
}

/// Who may read the files of a run. They hold the motion of a person's jaw.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum Readers {
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
    pub(crate) fn umask(self) -> Mode {
        match self {
            Self::Owner => Mode::RWXG | Mode::RWXO,
            Self::Group => Mode::WGRP | Mode::RWXO,
            Self::All => Mode::WGRP | Mode::WOTH,
        }
    }
}

/// The clock of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ClockKind {
    /// Real time where the kernel grants it, otherwise lockstep
    #[default]
    Auto,
    /// Real time, in three processes
    Rt,
    /// Simulated time in three processes that wait for each other: the same bytes as virtual
    Lockstep,
    /// Virtual time, in one thread: as fast as possible, the same bytes every time
    Virtual,
}
