//! Start and end of a process of the rig.
//!
//! The process writes one line of JSON to standard output: that it is ready, and the scheduling that the kernel granted. It
//! reads the epoch of the first cycle and the process ids of both loops from standard input. SIGTERM requests an orderly
//! end; the kernel also sends SIGTERM when the supervisor dies. All data travel over iceoryx2.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::config::{Scenario, ScenarioError};
use crate::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use crate::schedule::{CycleSchedule, ScheduleError};
use crate::transport::{Domain, DomainError, Node, TransportError};

/// The arguments of a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ProcessArguments {
    /// The resolved scenario.
    pub scenario: PathBuf,
    /// The id of the run's domain.
    pub domain: String,
    /// For a run in lockstep: how long a process may be silent. None for real time.
    pub lockstep: Option<Patience>,
}

/// How long a process may be silent in lockstep; none for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience(pub Option<Duration>);

impl Patience {
    /// Whether a silence of this length is not too long.
    pub fn lasts(self, silent_ns: u64) -> bool {
        self.0.is_none_or(|patience| u128::from(silent_ns) < patience.as_nanos())
    }
}

/// A process of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Party {
    /// The controller.
    Controller,
    /// The plant.
    Plant,
    /// The recorder.
    Recorder,
}

impl Party {
    /// Its name, which is also its subcommand.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::Plant => "plant",
            Self::Recorder => "recorder",
        }
    }
}

/// The report that another process has stopped answering, in lockstep.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Silence {
    /// The silent process.
    pub process: Party,
    /// The cycle in which it was waited for.
    pub cycle: u64,
    /// For how long, s.
    pub silent_s: f64,
}

impl Silence {
    /// Reports it to the supervisor.
    ///
    /// # Errors
    /// [`ProcessError::Pipe`].
    pub fn report(&self) -> Result<(), ProcessError> {
        report(self)
    }
}

fn report(message: &impl Serialize) -> Result<(), ProcessError> {
    let line = serde_json::to_string(message).expect("plain data");
    writeln!(io::stdout(), "{line}").map_err(ProcessError::Pipe)
}

/// The context of an initialised process.
#[derive(Debug)]
pub struct ProcessContext {
    /// The resolved scenario.
    pub scenario: Scenario,
    /// The cycle's time table.
    pub schedule: CycleSchedule,
    /// The node in the run's domain.
    pub node: Node,
    /// As in [`ProcessArguments`].
    pub lockstep: Option<Patience>,
    /// The request to end.
    pub stop: StopRequest,
}

/// Why a process could not start or run.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// The scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// The CAN link's time table.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// iceoryx2.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Signals cannot be received.
    #[error("cannot listen for signals: {0}")]
    Signals(io::Error),
    /// The pipes to the supervisor failed.
    #[error("the pipe to the supervisor failed: {0}")]
    Pipe(io::Error),
    /// The supervisor ended before the start, or cancelled the start.
    #[error("the supervisor ended or cancelled the start")]
    NoStart,
}

impl ProcessArguments {
    /// Reads the scenario, joins the domain and listens for the request to end.
    pub fn init(&self) -> Result<ProcessContext, ProcessError> {
        let stop = StopRequest::listen().map_err(ProcessError::Signals)?;
        let scenario = Scenario::read(&self.scenario)?;
        scenario.validate()?;
        let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns())?;
        let node = Node::join(&Domain::named(&self.domain)?)?;
        Ok(ProcessContext { scenario, schedule, node, lockstep: self.lockstep, stop })
    }
}

impl ProcessContext {
    /// Reports that the process is ready, and waits for the start; before, requests real-time scheduling on `core`, or none
    /// without a core and in lockstep. The ports are open by then, and none may use another user's memory.
    pub fn ready(&self, core: Option<usize>) -> Result<Start, ProcessError> {
        self.node.check_mapped()?;
        let realtime = &self.scenario.realtime;
        let core = core.filter(|_| self.lockstep.is_none());
        let scheduling = obtain(SchedulingRequest {
            core,
            fifo_priority: core.map(|_| realtime.priority),
            locked_memory: core.is_some() && realtime.lock_memory,
        });
        report(&Ready { scheduling })?;
        let mut line = String::new();
        io::stdin().read_line(&mut line).map_err(ProcessError::Pipe)?;
        serde_json::from_str(&line).map_err(|_| ProcessError::NoStart)
    }
}

/// The report that a process is ready.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ready {
    /// The requested and the granted scheduling.
    pub scheduling: Obtained,
}

/// The start of the first cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// Time of the first SYNC, ns of `CLOCK_MONOTONIC`.
    pub epoch_ns: u64,
    /// Process ids of controller and plant, for the recorder.
    pub loops: [u32; 2],
}

/// A request to end, made by a signal.
#[derive(Debug, Clone)]
pub struct StopRequest(Arc<AtomicBool>);

impl StopRequest {
    /// Listens for SIGTERM, also on the supervisor's death. A terminal sends SIGINT and SIGHUP to the whole
    /// process group; the supervisor reacts to them, and this process ignores them.
    fn listen() -> io::Result<Self> {
        Self::by(&[SIGINT, SIGHUP])?;
        let requested = Self::by(&[SIGTERM])?;
        set_parent_process_death_signal(Some(Signal::TERM))?;
        Ok(requested)
    }

    /// Listens for SIGTERM and SIGINT, in a process without a supervisor.
    pub fn listen_alone() -> io::Result<Self> {
        Self::by(&[SIGTERM, SIGINT])
    }

    fn by(signals: &[i32]) -> io::Result<Self> {
        let requested = Arc::default();
        for &signal in signals {
            signal_hook::flag::register(signal, Arc::clone(&requested))?;
        }
        Ok(Self(requested))
    }

    /// Whether a signal has requested the end.
    pub fn is_made(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
