//! Start and end of a process of the rig, and its line to the supervisor.
//!
//! The process reports its readiness and the granted scheduling to the supervisor. The answer has the epoch of the
//! first cycle and the process ids of both loops. The rig's own processes use standard output and input. SIGTERM
//! requests their orderly end; the kernel also sends SIGTERM at the death of the supervisor. A program of the user
//! [attaches](attach) over a socket. Messages to and from the supervisor are JSON, one a line. All data of the run
//! travel over iceoryx2.

pub mod attach;
mod link;
mod report;

use std::{io, path::PathBuf, time::Duration};

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
    /// For a run in lockstep, the longest silence of a process. None for real time.
    pub lockstep: Option<Patience>,
}

/// The longest silence of a process in lockstep; none for ever.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Patience(pub Option<Duration>);

impl Patience {
    /// Whether a silence of this length is short enough.
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

/// Why a process cannot start or run.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// The scenario is not usable.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The domain is not usable.
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
    /// The reception of signals fails.
    #[error("cannot listen for signals: {0}")]
    Signals(io::Error),
    /// The line to the supervisor failed.
    #[error("the line to the supervisor failed: {0}")]
    Supervisor(#[from] io::Error),
    /// The rig refuses this program.
    #[error("the rig refuses this program: {0}")]
    Refused(String),
    /// The supervisor has ended before the start, or has cancelled the start.
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

    /// Requests real-time scheduling on `core`, reports the process ready, and waits for the start. Without a core and
    /// in lockstep, requests no real-time scheduling. The ports are open by then, and none may use another user's
    /// memory. Only a controller has a declaration.
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
