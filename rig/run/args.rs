//! The arguments of `masseter run`.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, ValueEnum};

use crate::arguments::{Wires, parse_cores, parse_wires};
use crate::live;
use masseter_controller::process::Kind;
use masseter_plan::Overrides;
use masseter_terminal::Format;

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
    /// Play the motion, or only hold the position found at the start
    #[arg(long, value_enum, default_value_t)]
    pub controller: ControllerKind,
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

impl RunArgs {
    /// What the arguments change in the scenario.
    pub(super) fn overrides(&self) -> Overrides {
        Overrides {
            trajectory: self.trajectory.clone(),
            duration: self.duration,
            rate_hz: self.rate_hz,
            interfaces: self.can.as_ref().map(|wires| wires.0.clone()),
            cores: self.cores,
            seed: self.seed,
        }
    }
}

/// A controller of the rig.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum ControllerKind {
    /// Plays the scenario's motion.
    #[default]
    Motion,
    /// Holds the position found at the start, for as long as the motion takes.
    Hold,
}

impl ControllerKind {
    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Motion => "motion",
            Self::Hold => "hold",
        }
    }
}

impl From<ControllerKind> for Kind {
    fn from(kind: ControllerKind) -> Self {
        match kind {
            ControllerKind::Motion => Self::Motion,
            ControllerKind::Hold => Self::Hold,
        }
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

impl ClockKind {
    /// The name in the manifest.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rt => "rt",
            Self::Virtual => "virtual",
        }
    }
}
