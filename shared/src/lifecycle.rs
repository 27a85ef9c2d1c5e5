//! How a process of the rig begins and ends: what it tells its supervisor, and what it is told.
//!
//! Over standard output it says once, as a line of JSON, that it is ready and what scheduling it
//! obtained; over standard input it is told the epoch at which to begin, and the process ids of both
//! loops. SIGTERM asks it to end in order, and comes too when the supervisor dies. Everything else
//! travels over iceoryx2.

use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::config::{Scenario, ScenarioError};
use crate::realtime::scheduling::{Obtained, Wanted, obtain};
use crate::schedule::{CycleSchedule, ScheduleError};
use crate::transport::{Domain, DomainError, Node, TransportError};

/// What a process is started with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// The resolved scenario.
    pub scenario: PathBuf,
    /// The id of the run's domain.
    pub domain: String,
}

/// What every process of the rig has once it has taken up its assignment.
#[derive(Debug)]
pub struct Post {
    /// The resolved scenario.
    pub scenario: Scenario,
    /// The cycle's time table.
    pub schedule: CycleSchedule,
    /// Its place in the run's domain.
    pub node: Node,
    /// The request to end.
    pub stop: StopRequest,
}

/// Why a process could not do its work.
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
    #[error("talking to the supervisor failed: {0}")]
    Pipe(io::Error),
    /// The supervisor went away before it gave the word, or wants no start.
    #[error("the supervisor gave no start")]
    NoStart,
}

impl Assignment {
    /// Reads the scenario, joins the domain and listens for the request to end.
    pub fn take_up(&self) -> Result<Post, ProcessError> {
        let stop = StopRequest::listen().map_err(ProcessError::Signals)?;
        let scenario = Scenario::read(&self.scenario)?;
        scenario.validate()?;
        let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns())?;
        let node = Node::join(&Domain::named(&self.domain)?)?;
        Ok(Post { scenario, schedule, node, stop })
    }
}

impl Post {
    /// Asks for real time on a core, says that the process is ready, and waits for the word to begin.
    pub fn ready_on(&self, core: usize) -> Result<Start, ProcessError> {
        let realtime = &self.scenario.realtime;
        ready_and_wait(obtain(Wanted {
            core: Some(core),
            fifo_priority: Some(realtime.priority),
            locked_memory: realtime.lock_memory,
        }))
    }

    /// The same without real time.
    pub fn ready(&self) -> Result<Start, ProcessError> {
        ready_and_wait(obtain(Wanted { core: None, fifo_priority: None, locked_memory: false }))
    }
}

/// A process's word that it is ready.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Ready {
    /// What it asked of the kernel and what it got.
    pub scheduling: Obtained,
}

/// The supervisor's word to begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Start {
    /// Time of the first SYNC, ns of `CLOCK_MONOTONIC`.
    pub epoch_ns: u64,
    /// Process ids of controller and plant, for who watches them.
    pub loops: [u32; 2],
}

/// A request to end, as signals make it.
#[derive(Debug, Clone)]
pub struct StopRequest(Arc<AtomicBool>);

impl StopRequest {
    /// Listens for SIGTERM, also on the supervisor's death. SIGINT and SIGHUP reach the whole process group
    /// from a terminal and are the supervisor's affair: here they do nothing.
    fn listen() -> io::Result<Self> {
        let requested = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(SIGTERM, Arc::clone(&requested))?;
        for signal in [SIGINT, SIGHUP] {
            signal_hook::flag::register(signal, Arc::new(AtomicBool::new(false)))?;
        }
        set_parent_process_death_signal(Some(Signal::TERM))?;
        Ok(Self(requested))
    }

    /// Listens for SIGTERM and SIGINT, for a process without supervisor.
    pub fn listen_alone() -> io::Result<Self> {
        let requested = Arc::new(AtomicBool::new(false));
        for signal in [SIGTERM, SIGINT] {
            signal_hook::flag::register(signal, Arc::clone(&requested))?;
        }
        Ok(Self(requested))
    }

    /// Whether the end has been asked for.
    pub fn is_made(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Says that this process is ready, and waits for the word to begin.
fn ready_and_wait(scheduling: Obtained) -> Result<Start, ProcessError> {
    say(&Ready { scheduling }).map_err(ProcessError::Pipe)?;
    let mut line = String::new();
    io::stdin().lock().read_line(&mut line).map_err(ProcessError::Pipe)?;
    serde_json::from_str(&line).map_err(|_| ProcessError::NoStart)
}

fn say(ready: &Ready) -> io::Result<()> {
    let mut output = io::stdout().lock();
    serde_json::to_writer(&mut output, ready)?;
    writeln!(output)?;
    output.flush()
}
