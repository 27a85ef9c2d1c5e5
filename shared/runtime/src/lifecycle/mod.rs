//! Start and end of a process of the rig, and its line to the supervisor.
//!
//! The process reports to the supervisor that it is ready, and the scheduling that the kernel granted. It gets the epoch of
//! the first cycle and the process ids of both loops. The own processes use standard output and input for that; SIGTERM
//! requests their orderly end, and the kernel also sends SIGTERM when the supervisor dies. A program of the user
//! [attaches](attach) over a socket. Messages to and from the supervisor are JSON, one a line. All data of the run travel
//! over iceoryx2.

pub mod attach;
mod link;
mod report;

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use masseter_scenario::{Scenario, ScenarioError};

use crate::injection::OperatorError;
use crate::named::{Declared, NameError};
use crate::realtime::scheduling::{SchedulingRequest, obtain};
use crate::schedule::{CycleSchedule, ScheduleError};
use crate::transport::{Domain, DomainError, Node, TransportError};

pub use link::StopRequest;
pub(crate) use link::SupervisorLink;
pub use report::{End, Order, Party, Report, ReportError, Silence, Start};

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
    pub(crate) link: SupervisorLink,
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
    /// A signal or parameter of the controller, or a value for one.
    #[error(transparent)]
    Name(#[from] NameError),
    /// The operator of the scenario.
    #[error(transparent)]
    Operator(#[from] OperatorError),
    /// Other programs cannot reach the controller's parameters.
    #[error("cannot serve the parameters: {0}")]
    Parameters(io::Error),
    /// Signals cannot be received.
    #[error("cannot listen for signals: {0}")]
    Signals(io::Error),
    /// The line to the supervisor failed.
    #[error("the line to the supervisor failed: {0}")]
    Supervisor(#[from] io::Error),
    /// The rig does not take this program.
    #[error("the rig refuses this program: {0}")]
    Refused(String),
    /// The supervisor ended before the start, or cancelled the start.
    #[error("the supervisor ended or cancelled the start")]
    NoStart,
}

impl ProcessArguments {
    /// Reads the scenario, joins the domain and listens for the request to end.
    pub fn init(&self) -> Result<ProcessContext, ProcessError> {
        let stop = StopRequest::listen().map_err(ProcessError::Signals)?;
        ProcessContext::new(self, stop, SupervisorLink::Pipes)
    }
}

impl ProcessContext {
    fn new(
        arguments: &ProcessArguments,
        stop: StopRequest,
        link: SupervisorLink,
    ) -> Result<Self, ProcessError> {
        let scenario = Scenario::read(&arguments.scenario)?;
        scenario.validate()?;
        let schedule = CycleSchedule::new(&scenario)?;
        let node = Node::join(&Domain::named(&arguments.domain)?)?;
        Ok(Self { scenario, schedule, node, lockstep: arguments.lockstep, stop, link })
    }

    /// Reports that the process is ready, and waits for the start; before, requests real-time scheduling on `core`, or none
    /// without a core and in lockstep. The ports are open by then, and none may use another user's memory. Only a controller
    /// declares anything.
    pub fn ready(&self, core: Option<usize>, declared: Declared) -> Result<Start, ProcessError> {
        self.node.domain().check_mapped()?;
        let realtime = &self.scenario.realtime;
        let core = core.filter(|_| self.lockstep.is_none());
        let scheduling = obtain(SchedulingRequest {
            core,
            fifo_priority: core.map(|_| realtime.priority),
            locked_memory: core.is_some() && realtime.lock_memory,
        });
        self.link.report(&Report::Ready { scheduling, declared })?;
        match self.link.next_order()? {
            Some(Order::Start(start)) => Ok(start),
            Some(Order::Refused { reason }) => Err(ProcessError::Refused(reason)),
            Some(Order::Struck | Order::Stop) | None => Err(ProcessError::NoStart),
        }
    }
}
