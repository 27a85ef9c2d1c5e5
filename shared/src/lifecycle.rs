//! How a process of the rig begins and ends: what it tells its supervisor, and what it is told.
//!
//! Over standard output it says once, as a line of JSON, that it is ready and what scheduling it
//! obtained; over standard input it is told the epoch at which to begin. SIGTERM asks it to end in
//! order, and comes too when the supervisor dies. Everything else travels over iceoryx2.

use std::io::{self, BufRead, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGINT, SIGTERM};

use crate::config::{Scenario, ScenarioError};
use crate::realtime::scheduling::Obtained;
use crate::transport::{Domain, DomainError};

/// What a process is started with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Assignment {
    /// The resolved scenario.
    pub scenario: PathBuf,
    /// The id of the run's domain.
    pub domain: String,
}

impl Assignment {
    /// Reads the scenario and names the domain.
    pub fn open(&self) -> Result<(Scenario, Domain), AssignmentError> {
        Ok((Scenario::read(&self.scenario)?, Domain::named(&self.domain)?))
    }
}

/// An assignment that cannot be taken up.
#[derive(Debug, thiserror::Error)]
pub enum AssignmentError {
    /// The scenario cannot be used.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The domain cannot be used.
    #[error(transparent)]
    Domain(#[from] DomainError),
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
}

/// Why a process did not begin.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The pipes to the supervisor failed.
    #[error("talking to the supervisor failed: {0}")]
    Pipe(#[from] io::Error),
    /// The supervisor went away before it gave the word, or wants no start.
    #[error("the supervisor gave no start")]
    NoStart,
}

/// A request to end, as signals make it.
#[derive(Debug, Clone)]
pub struct StopRequest(Arc<AtomicBool>);

impl StopRequest {
    /// Listens for SIGTERM, also on the supervisor's death. SIGINT reaches the whole process group
    /// from a terminal and is the supervisor's affair: here it does nothing.
    pub fn listen() -> io::Result<Self> {
        let requested = Arc::new(AtomicBool::new(false));
        signal_hook::flag::register(SIGTERM, Arc::clone(&requested))?;
        signal_hook::flag::register(SIGINT, Arc::new(AtomicBool::new(false)))?;
        set_parent_process_death_signal(Some(Signal::TERM))?;
        Ok(Self(requested))
    }

    /// Whether the end has been asked for.
    pub fn is_made(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Says that this process is ready, and waits for the word to begin.
pub fn ready_and_wait(scheduling: Obtained) -> Result<Start, StartError> {
    let mut output = io::stdout().lock();
    serde_json::to_writer(&mut output, &Ready { scheduling }).map_err(io::Error::from)?;
    writeln!(output)?;
    output.flush()?;
    let mut line = String::new();
    io::stdin().lock().read_line(&mut line)?;
    serde_json::from_str(&line).map_err(|_| StartError::NoStart)
}
