//! Start and end of a process of the rig, and its line to the supervisor.
//!
//! The process reports to the supervisor that it is ready, and the scheduling that the kernel granted. It gets the epoch of
//! the first cycle and the process ids of both loops. The own processes use standard output and input for that; SIGTERM
//! requests their orderly end, and the kernel also sends SIGTERM when the supervisor dies. A program of the user
//! [attaches](attach) over a socket. Messages to and from the supervisor are JSON, one a line. All data of the run travel
//! over iceoryx2.

pub mod attach;

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

use masseter_scenario::input::{excerpt, sentence};
use masseter_scenario::{Scenario, ScenarioError};
use rustix::io::Errno;
use rustix::net::{SendFlags, send};
use rustix::process::{Signal, set_parent_process_death_signal};
use serde::{Deserialize, Serialize};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::injection::OperatorError;
use crate::named::{Declared, NameError};
use crate::realtime::scheduling::{Obtained, SchedulingRequest, obtain};
use crate::schedule::{CycleSchedule, ScheduleError};
use crate::transport::{Domain, DomainError, Node, TransportError};

pub use crate::conversation::line;

/// Longest silence that a process can report, s.
const LONGEST_SILENCE_S: f64 = 1e7;
/// Most refusals of the kernel: core, priority, memory.
const MOST_REFUSALS: usize = 3;

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
    Supervisor(io::Error),
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
    /// without a core and in lockstep. The ports are open by then, and none may use another user's memory.
    pub fn ready(&self, core: Option<usize>) -> Result<Start, ProcessError> {
        self.ready_with(core, &Declared::default())
    }

    /// The same for a controller with signals and parameters.
    pub(crate) fn ready_with(&self, core: Option<usize>, declared: &Declared) -> Result<Start, ProcessError> {
        self.node.check_mapped()?;
        let realtime = &self.scenario.realtime;
        let core = core.filter(|_| self.lockstep.is_none());
        let scheduling = obtain(SchedulingRequest {
            core,
            fifo_priority: core.map(|_| realtime.priority),
            locked_memory: core.is_some() && realtime.lock_memory,
        });
        self.link.report(&Report::Ready { scheduling, declared: declared.clone() })?;
        match self.link.await_start()? {
            Some(Order::Start(start)) => Ok(start),
            Some(Order::Refused { reason }) => Err(ProcessError::Refused(reason)),
            Some(Order::Struck | Order::Stop) | None => Err(ProcessError::NoStart),
        }
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

/// A message of a process to the supervisor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Report {
    /// The ports are open.
    Ready {
        /// The requested and the granted scheduling.
        scheduling: Obtained,
        /// The signals and parameters of a controller.
        #[serde(default)]
        declared: Declared,
    },
    /// Another process has stopped answering, in lockstep.
    Silence(Silence),
    /// A fault of a process is due, which the supervisor carries out.
    Due {
        /// Its place in the scenario's list.
        fault: usize,
        /// Now, ns of the run's clock.
        now_ns: u64,
    },
    /// An attached program has ended its work. The own processes end with an exit code instead.
    Ended(End),
}

/// Why a line is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// It has another form.
    #[error("'{line}' is no report of this version: {reason}")]
    Form {
        /// The beginning of the line.
        line: String,
        /// What the reader misses.
        reason: String,
    },
    /// No recording can have the signals and parameters.
    #[error("{0}")]
    Declared(#[from] NameError),
    /// The kernel refuses less.
    #[error("it reports {0} refusals of the kernel: there are at most {MOST_REFUSALS}")]
    Refusals(usize),
    /// No process can have been silent for so long.
    #[error("it reports a silence of {0:e} s: use 0 to {LONGEST_SILENCE_S:e} s")]
    Silence(f64),
}

impl Report {
    /// The report in a line of a process, whose values and texts can be recorded and shown. Its sentences are cut to
    /// 200 characters.
    ///
    /// # Errors
    /// [`ReportError`].
    pub fn read(line: &str) -> Result<Self, ReportError> {
        let mut report = serde_json::from_str(line).map_err(|error| ReportError::Form {
            line: excerpt(line),
            reason: excerpt(&error.to_string()),
        })?;
        match &mut report {
            Self::Ready { scheduling: Obtained { refusals, .. }, declared } => {
                declared.check()?;
                if refusals.len() > MOST_REFUSALS {
                    return Err(ReportError::Refusals(refusals.len()));
                }
                for refusal in refusals {
                    *refusal = sentence(refusal);
                }
            }
            Self::Silence(Silence { silent_s, .. }) if !(0.0..=LONGEST_SILENCE_S).contains(silent_s) => {
                return Err(ReportError::Silence(*silent_s));
            }
            Self::Ended(End::Failed { reason }) => *reason = sentence(reason),
            Self::Silence(_) | Self::Due { .. } | Self::Ended(_) => {}
        }
        Ok(report)
    }
}

/// How an attached program ended its work.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// It did what it was asked to.
    Finished,
    /// A fault ended the motion.
    SafeStop,
    /// It cannot go on.
    Failed {
        /// Why.
        reason: String,
    },
}

/// A message of the supervisor to a process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// Start of the first cycle.
    Start(Start),
    /// In lockstep: the fault that was due has struck, or could not.
    Struck,
    /// Come to an orderly end. The own processes get SIGTERM instead.
    Stop,
    /// The rig does not take the program: what it reports cannot be recorded or shown.
    Refused {
        /// Why, and the limit.
        reason: String,
    },
}

/// The start of the first cycle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Time of the first SYNC, ns of `CLOCK_MONOTONIC`.
    pub epoch_ns: u64,
    /// Process ids of controller and plant, for the recorder.
    pub loops: [u32; 2],
    /// The signals and parameters of the controller, for the recorder.
    pub declared: Declared,
}

/// The process's end of the line.
#[derive(Debug, Clone)]
pub(crate) enum SupervisorLink {
    /// Standard input and output of a process that the supervisor has started from its own executable.
    Pipes,
    /// The socket of an attached program, whose standard input and output are the user's.
    Socket(Arc<Socket>),
}

/// An attached program's end of the socket.
#[derive(Debug)]
pub(crate) struct Socket {
    stream: UnixStream,
    /// The order that follows the report of readiness.
    starts: Mutex<Receiver<Order>>,
    strikes: Mutex<Receiver<()>>,
}

impl SupervisorLink {
    /// The line over a connected socket, and the request to end: an order, or the end of the supervisor.
    fn over(stream: UnixStream) -> io::Result<(Self, StopRequest)> {
        let input = BufReader::new(stream.try_clone()?);
        let (sender, starts) = channel();
        let (struck, strikes) = channel();
        let stop = StopRequest::default();
        let to_request = stop.clone();
        thread::Builder::new().name("supervisor".to_owned()).spawn(move || {
            for line in input.lines().map_while(Result::ok) {
                let is_taken = match serde_json::from_str(&line) {
                    Ok(order @ (Order::Start(_) | Order::Refused { .. })) => sender.send(order).is_ok(),
                    Ok(Order::Struck) => struck.send(()).is_ok(),
                    Ok(Order::Stop) | Err(_) => false,
                };
                if !is_taken {
                    break;
                }
            }
            to_request.make();
        })?;
        let socket = Socket { stream, starts: Mutex::new(starts), strikes: Mutex::new(strikes) };
        Ok((Self::Socket(Arc::new(socket)), stop))
    }

    /// Reports to the supervisor.
    pub(crate) fn report(&self, report: &Report) -> Result<(), ProcessError> {
        let line = line(report);
        let sent = match self {
            Self::Pipes => io::stdout().write_all(line.as_bytes()),
            Self::Socket(socket) => send_all(&socket.stream, line.as_bytes()),
        };
        sent.map_err(ProcessError::Supervisor)
    }

    /// Waits for the order to start, or a refusal; none when the supervisor ends or cancels the start.
    fn await_start(&self) -> Result<Option<Order>, ProcessError> {
        match self {
            Self::Pipes => {
                let mut line = String::new();
                io::stdin().read_line(&mut line).map_err(ProcessError::Supervisor)?;
                Ok(serde_json::from_str(&line).ok())
            }
            Self::Socket(socket) => Ok(socket.starts.lock().ok().and_then(|starts| starts.recv().ok())),
        }
    }

    /// Waits until the supervisor has carried out a fault; also ends when the supervisor does.
    pub(crate) fn await_struck(&self) -> Result<(), ProcessError> {
        match self {
            Self::Pipes => {
                io::stdin().read_line(&mut String::new()).map(drop).map_err(ProcessError::Supervisor)
            }
            Self::Socket(socket) => {
                let _ = socket.strikes.lock().map(|strikes| strikes.recv());
                Ok(())
            }
        }
    }

    /// Reports the end of an attached program's work. An exit code reports that of the own processes.
    pub(crate) fn end(&self, end: End) -> Result<(), ProcessError> {
        match self {
            Self::Pipes => Ok(()),
            Self::Socket(_) => self.report(&Report::Ended(end)),
        }
    }
}

/// Sends without SIGPIPE, which would end a program that is not written in Rust.
fn send_all(stream: &UnixStream, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match send(stream, bytes, SendFlags::NOSIGNAL) {
            Ok(sent) => bytes = &bytes[sent..],
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
    Ok(())
}

/// A request to end.
#[derive(Debug, Clone, Default)]
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
        Self::by(&[SIGTERM, SIGINT, SIGHUP])
    }

    fn by(signals: &[i32]) -> io::Result<Self> {
        let requested = Self::default();
        for &signal in signals {
            signal_hook::flag::register(signal, Arc::clone(&requested.0))?;
        }
        Ok(requested)
    }

    fn make(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether the end has been requested.
    pub fn is_made(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use masseter_scenario::input::is_printable;

    use super::*;

    const SCHEDULING: &str = r#"{"requested":{"core":null,"fifo_priority":null,"locked_memory":false},"core":null,"fifo_priority":null,"locked_memory":false,"refusals":REFUSALS}"#;

    fn ready(refusals: &str, declared: &str) -> String {
        let scheduling = SCHEDULING.replace("REFUSALS", refusals);
        format!(r#"{{"ready":{{"scheduling":{scheduling},"declared":{declared}}}}}"#)
    }

    #[test]
    fn what_cannot_be_recorded_or_shown_is_refused_with_the_limit() {
        for (line, limit) in [
            (ready("[]", r#"{"signals":[{"name":"</script>","unit":"","about":""}]}"#), "lower-case letters"),
            (
                ready("[]", r#"{"signals":[{"name":"a","unit":"\u001b[2J","about":""}]}"#),
                "printable characters",
            ),
            (ready(r#"["","","",""]"#, "{}"), "at most 3"),
            (r#"{"silence":{"process":"plant","cycle":1,"silent_s":1e308}}"#.to_owned(), "0 to 1e7 s"),
            (r#"{"silence":{"process":"plant","cycle":1,"silent_s":-1}}"#.to_owned(), "0 to 1e7 s"),
            ("\u{1b}[2J".repeat(10_000), "no report of this version"),
            (format!(r#"{{"{}":1}}"#, "\\u001b".repeat(10_000)), "no report of this version"),
        ] {
            let refusal = Report::read(&line).unwrap_err().to_string();
            assert!(refusal.contains(limit) && is_printable(&refusal, 600), "{refusal}");
        }
    }

    #[test]
    fn sentences_are_short_and_command_nothing() {
        let hostile = format!("\\u001b[31m\\n{}", "z".repeat(1000));
        let line = ready(&format!(r#"["{hostile}"]"#), "{}");
        let Ok(Report::Ready { scheduling, .. }) = Report::read(&line) else { panic!("no report") };
        let failed = format!(r#"{{"ended":{{"failed":{{"reason":"{hostile}"}}}}}}"#);
        let Ok(Report::Ended(End::Failed { reason })) = Report::read(&failed) else { panic!("no report") };
        for sentence in [&scheduling.refusals[0], &reason] {
            assert!(sentence.starts_with("\\u{1b}[31m\\n") && sentence.chars().count() <= 201, "{sentence}");
        }
    }
}
