//! What a run is asked for, as the arguments of `masseter run` have it. The other verbs set some of it.

use std::{net::SocketAddr, os::unix::fs::PermissionsExt, str::FromStr, time::Duration};

use clap::ValueEnum;
use masseter_controller::hold_position::HoldPosition;
use masseter_controller::motion_controller::MotionController;
use masseter_controller::process::BuildController;
use masseter_plan::{enter_dry_run, set_keys};
use masseter_recorder::live;
use masseter_runtime::lifecycle::Patience;
use rustix::fs::Mode;

use crate::cli::arguments::{Wires, parse_address, parse_cores, parse_duration, parse_patience, parse_wires};
use crate::prelude::*;

/// The patience of a run in lockstep.
const DEFAULT_PATIENCE: Duration = Duration::from_secs(10);

/// How Python starts the program of the package that plays an FMU.
const FMU_PLAYER: [&str; 2] = ["-m", "masseter.fmu"];

const WHAT: &str = "Choose what to play";
const HOW: &str = "Choose how it runs";
const WATCH: &str = "Watch the run";
const KEEP: &str = "Keep the result";

/// A run, as the command line asks for it. The default one is ten seconds of chewing by the rig's own controller.
#[derive(Debug, Clone, Default, Args)]
#[command(
    after_help = "Examples:\n  masseter run --duration 30\n  masseter run scenario.toml --live\n  masseter run --clock virtual --seed 2 --out /tmp/run"
)]
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
pub(crate) struct RunRequest {
    /// Scenario file [default: the built-in scenario, ten seconds of chewing]
    pub(super) scenario: Option<PathBuf>,
    /// Recorded jaw motion (CSV, TRC, MOT, STO or C3D), instead of the scenario's motion
    #[arg(long, value_name = "FILE", help_heading = WHAT)]
    pub(super) trajectory: Option<PathBuf>,
    /// Duration of the motion in seconds, or with a unit, such as 10, 10s or 2min
    #[arg(long, value_name = "TIME", value_parser = parse_duration, allow_negative_numbers = true, help_heading = WHAT)]
    pub(super) duration: Option<Duration>,
    /// Change a key of the scenario, such as controller.integral_gain_per_s=50; may be given several times
    #[arg(long, value_name = "KEY=VALUE", help_heading = WHAT)]
    pub(super) set: Vec<String>,
    /// Cycles per second
    #[arg(long, value_name = "HZ", allow_negative_numbers = true, help_heading = HOW)]
    pub(super) rate_hz: Option<u32>,
    /// Clock of the run
    #[arg(long, value_enum, default_value_t, help_heading = HOW)]
    pub(super) clock: ClockKind,
    /// In lockstep, how long a process may take to answer before the run ends: such as 10s, or none for a debugger
    /// [default: 10s]
    #[arg(long, value_name = "TIME", value_parser = parse_patience, help_heading = HOW)]
    pub(super) patience: Option<Patience>,
    /// Who controls the robot: motion plays the motion, hold keeps the position found at the start, a path starts
    /// your own program, also with arguments ("python3 law.py --gain 2"), fmu:FILE.fmu an FMU (see --map), external waits
    /// until you start it [default: motion]
    #[arg(
        long,
        value_name = "motion|hold|external|none|PROGRAM|fmu:FILE.fmu",
        default_value = "motion",
        hide_default_value = true,
        help_heading = WHAT
    )]
    pub(super) controller: ControllerChoice,
    /// Which values of the rig the variables of an FMU are [default: the FMU's path with .toml]
    #[arg(long, value_name = "FILE.toml", help_heading = WHAT)]
    pub(super) map: Option<String>,
    /// Simulated buses, or the CAN interface of each bus, such as can0,can1
    #[arg(long, value_name = "virtual|IF[,IF]", value_parser = parse_wires, help_heading = HOW)]
    pub(super) can: Option<Wires>,
    /// Move a robot without a passed 'masseter robot check-pose': a wrong sign, scale or zero can drive an axis into
    /// its end
    #[arg(long, help_heading = HOW)]
    pub(super) without_bring_up: bool,
    /// Play the motion at a tenth of its speed with little force, and predict what it demands at full speed
    #[arg(long, help_heading = HOW)]
    pub(super) dry: bool,
    /// Reset the fault of a drive that is in fault at the start, instead of ending the run
    #[arg(long, help_heading = HOW)]
    pub(super) reset_faults: bool,
    /// How long to wait for a drive that is not ready, such as one with safe torque off [default: 5s]
    #[arg(long, value_name = "TIME", value_parser = parse_duration, help_heading = HOW)]
    pub(super) wait_ready: Option<Duration>,
    /// Cores of controller and plant
    #[arg(long, value_name = "N,N", value_parser = parse_cores, help_heading = HOW)]
    pub(super) cores: Option<[usize; 2]>,
    /// Seed of every random number
    #[arg(long, allow_negative_numbers = true, help_heading = HOW)]
    pub(super) seed: Option<u64>,
    /// Run folder; must not exist [default: runs/UTC_TIME-NAME]
    #[arg(long, value_name = "DIR", help_heading = KEEP)]
    pub(super) out: Option<PathBuf>,
    /// Name of this rig, unique among running rigs [default: a generated one]
    #[arg(long, help_heading = HOW)]
    pub(super) name: Option<String>,
    /// Format of standard output
    #[arg(long, value_enum, default_value_t, help_heading = WATCH)]
    pub(super) format: Format,
    /// Exit with 3 unless the kernel grants cores, SCHED_FIFO, locked memory and, if requested, /dev/cpu_dma_latency
    #[arg(long, help_heading = HOW)]
    pub(super) require_rt: bool,
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
    pub(super) live: Option<SocketAddr>,
    /// Who may read the run's files
    #[arg(long, value_enum, default_value_t, value_name = "WHO", help_heading = KEEP)]
    pub(crate) readable_by: Readers,
    /// Show every figure, not only verdict and checks
    #[arg(long, help_heading = WATCH)]
    pub(super) verbose: bool,
    /// Show no progress
    #[arg(long, help_heading = WATCH)]
    pub(super) quiet: bool,
}

impl RunRequest {
    /// Changes the scenario. Values of keys come first.
    pub(super) fn change(&self, scenario: &mut Scenario) -> anyhow::Result<()> {
        set_keys(scenario, self.trajectory.as_deref(), &self.set)?;
        if let Some(duration) = self.duration {
            scenario.duration_s = Some(duration.as_secs_f64());
        }
        if let Some(Wires(interfaces)) = &self.can {
            scenario.can.interfaces.clone_from(interfaces);
        }
        if self.dry {
            enter_dry_run(scenario);
        }
        scenario.can.reset_faults |= self.reset_faults;
        if let Some(wait) = self.wait_ready {
            scenario.can.ready_timeout_ms =
                u32::try_from(wait.as_millis()).ok().context("--wait-ready: use at most 49 days")?;
        }
        scenario.rate_hz = self.rate_hz.unwrap_or(scenario.rate_hz);
        scenario.seed = self.seed.unwrap_or(scenario.seed);
        scenario.realtime.cores = self.cores.unwrap_or(scenario.realtime.cores);
        Ok(())
    }

    /// For how long a process may be silent, if the run is in lockstep.
    pub(super) fn lockstep(&self) -> Option<Patience> {
        let patience = self.patience.unwrap_or(Patience(Some(DEFAULT_PATIENCE)));
        (self.clock == ClockKind::Lockstep).then_some(patience)
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

/// A controller of the rig.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub(crate) enum ControllerKind {
    /// Plays the motion of the scenario
    #[default]
    Motion,
    /// Holds the position found at the start, for as long as the motion takes
    Hold,
}

impl ControllerKind {
    /// The controller that a manifest names; none for a program of the user.
    pub(crate) fn of_manifest(name: Option<&str>) -> Option<Self> {
        name.map_or_else(|| Some(Self::default()), |name| Self::from_str(name, false).ok())
    }

    /// How the controller is built.
    pub(crate) fn builder(self) -> BuildController {
        match self {
            Self::Motion => {
                |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion))
            }
            Self::Hold => |scenario, mechanism, motion| {
                Box::new(HoldPosition::new(scenario, mechanism, motion.duration_s()))
            },
        }
    }
}

/// Who controls the robot in a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum ControllerChoice {
    /// A controller of the rig.
    Own(ControllerKind),
    /// A program that the user starts.
    External,
    /// A program that the rig starts, with its arguments.
    Executable(PathBuf, Vec<String>),
    /// Nobody, or whoever publishes commands: the rig starts, invites and watches no controller.
    None,
}

/// Whether these arguments of Python play an FMU.
pub(super) fn is_fmu_player(arguments: &[String]) -> bool {
    arguments.starts_with(&FMU_PLAYER.map(str::to_owned))
}

impl Default for ControllerChoice {
    fn default() -> Self {
        Self::Own(ControllerKind::default())
    }
}

impl FromStr for ControllerChoice {
    type Err = String;

    /// The name of a controller of the rig, `external`, `none`, the path of an executable file, or a command line: a
    /// program and its arguments, with the quotes of a shell.
    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(kind) = ControllerKind::from_str(text, false) {
            return Ok(Self::Own(kind));
        }
        match text {
            "external" => return Ok(Self::External),
            "none" => return Ok(Self::None),
            _ => {}
        }
        if let Some(file) = text.strip_prefix("fmu:") {
            if !Path::new(file).is_file() {
                return Err(format!("{file} is no file: give the path of an FMU"));
            }
            let arguments = FMU_PLAYER.into_iter().chain([file]).map(str::to_owned);
            return Ok(Self::Executable("python3".into(), arguments.collect()));
        }
        // A path may contain spaces.
        let words = if Path::new(text).exists() { None } else { shlex::split(text) };
        if let Some([program, arguments @ ..]) = words.as_deref().filter(|words| words.len() > 1) {
            let path = if program.contains('/') { std::path::absolute(program) } else { Ok(program.into()) };
            return path
                .map(|path| Self::Executable(path, arguments.to_vec()))
                .map_err(|error| error.to_string());
        }
        let path = PathBuf::from(text);
        match path.metadata() {
            Ok(found) if found.is_file() && found.permissions().mode() & 0o111 != 0 => {
                // Without a folder, the system would search PATH.
                std::path::absolute(path)
                    .map(|path| Self::Executable(path, Vec::new()))
                    .map_err(|error| error.to_string())
            }
            Ok(found) if found.is_file() => Err(format!("the file is not executable: chmod +x {text}")),
            Ok(found) => {
                let kind = if found.is_dir() { "a folder" } else { "no regular file" };
                Err(format!("it is {kind}: give the executable file of your controller"))
            }
            Err(error) => {
                Err(format!("use motion, hold, external, none, or the path of an executable file ({error})"))
            }
        }
    }
}

impl ControllerChoice {
    /// How a controller of the rig is built; none for a program of the user.
    pub(crate) fn builder(&self) -> Option<BuildController> {
        match self {
            Self::Own(kind) => Some(kind.builder()),
            Self::External | Self::Executable(..) | Self::None => None,
        }
    }

    /// Its name in the manifest; none for the controller that runs by default.
    pub(crate) fn name(&self) -> Option<String> {
        match self {
            Self::Own(kind) => Some(name_of(kind)).filter(|_| *kind != ControllerKind::default()),
            Self::External => Some("external".to_owned()),
            Self::None => Some("none".to_owned()),
            Self::Executable(path, arguments) if arguments.is_empty() => Some(path.display().to_string()),
            Self::Executable(path, arguments) => Some(format!("{} {}", path.display(), arguments.join(" "))),
        }
    }

    /// The choice with this map of an FMU's variables.
    pub(crate) fn with_map(self, map: Option<&String>) -> anyhow::Result<Self> {
        let Some(map) = map else { return Ok(self) };
        match self {
            Self::Executable(program, mut arguments) if is_fmu_player(&arguments) => {
                arguments.push(map.clone());
                Ok(Self::Executable(program, arguments))
            }
            _ => bail!("--map is for --controller fmu:FILE.fmu"),
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

/// The name of a value on the command line.
pub(crate) fn name_of(value: &impl ValueEnum) -> String {
    value.to_possible_value().expect("no value is skipped").get_name().to_owned()
}
