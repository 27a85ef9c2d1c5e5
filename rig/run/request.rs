//! What a run is asked for: scenario, clock, controller, folder. The verbs make it of their arguments.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::ValueEnum;
use masseter_controller::hold_position::HoldPosition;
use masseter_controller::motion_controller::MotionController;
use masseter_controller::process::BuildController;
use masseter_plan::Overrides;
use masseter_runtime::lifecycle::Patience;

/// The patience of a run in lockstep.
const DEFAULT_PATIENCE: Duration = Duration::from_secs(10);

/// A run. The default one is ten seconds of chewing by the rig's own controller.
#[derive(Debug, Clone, Default)]
pub(crate) struct RunRequest {
    /// Scenario file; the default scenario without one.
    pub(crate) scenario: Option<PathBuf>,
    /// Changes to the scenario.
    pub(crate) overrides: Overrides,
    pub(crate) clock: ClockKind,
    /// For how long a process may be silent in lockstep.
    pub(crate) patience: Option<Patience>,
    pub(crate) controller: ControllerChoice,
    /// Whether a robot moves without the evidence of a bring-up.
    pub(crate) without_bring_up: bool,
    /// Run folder, which must not exist; one by time without it.
    pub(crate) out: Option<PathBuf>,
    /// Name of the rig.
    pub(crate) name: Option<String>,
    /// Whether the motion starts only if the kernel grants real time.
    pub(crate) require_rt: bool,
    /// Where the live view listens.
    pub(crate) live: Option<SocketAddr>,
    /// Whether no progress is shown.
    pub(crate) quiet: bool,
}

impl RunRequest {
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
    /// A program that the rig starts.
    Executable(PathBuf),
    /// Nobody, or whoever publishes commands: the rig starts, invites and watches no controller.
    None,
}

impl Default for ControllerChoice {
    fn default() -> Self {
        Self::Own(ControllerKind::default())
    }
}

impl ControllerChoice {
    /// How a controller of the rig is built; none for a program of the user.
    pub(crate) fn builder(&self) -> Option<BuildController> {
        match self {
            Self::Own(kind) => Some(kind.builder()),
            Self::External | Self::Executable(_) | Self::None => None,
        }
    }

    /// Its name in the manifest; none for the controller that runs by default.
    pub(crate) fn name(&self) -> Option<String> {
        match self {
            Self::Own(kind) => Some(name_of(kind)).filter(|_| *kind != ControllerKind::default()),
            Self::External => Some("external".to_owned()),
            Self::None => Some("none".to_owned()),
            Self::Executable(path) => Some(path.display().to_string()),
        }
    }
}

/// The name of a value on the command line.
pub(crate) fn name_of(value: &impl ValueEnum) -> String {
    value.to_possible_value().expect("no value is skipped").get_name().to_owned()
}
