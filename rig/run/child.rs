//! A child process of the supervisor: start, readiness, end. It does not decide what its end means for the run.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use masseter_shared::lifecycle::{Ready, Start};
use rustix::process::{Pid, Signal, kill_process};

/// Longest time for a process to open its ports and lock its memory.
const READY_TIMEOUT: Duration = Duration::from_secs(20);

/// Polling interval while waiting for readiness.
const POLL: Duration = Duration::from_millis(20);

/// A process of the rig, by its task.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The controller.
    Controller,
    /// The plant.
    Plant,
    /// The recorder.
    Recorder,
}

impl Role {
    /// Its name, which is also its hidden subcommand.
    pub fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::Plant => "plant",
            Self::Recorder => "recorder",
        }
    }
}

/// Why a process did not start.
#[derive(Debug, thiserror::Error)]
pub enum ChildError {
    /// The system could not start it.
    #[error("the {role} cannot be started: {error}")]
    Spawn {
        /// Its name.
        role: &'static str,
        /// The system's error.
        error: io::Error,
    },
    /// It did not report that it is ready.
    #[error("the {role} did not get ready: {reason}")]
    NotReady {
        /// Its name.
        role: &'static str,
        /// The reason.
        reason: String,
    },
}

/// A process; killed when dropped.
pub struct Process {
    role: Role,
    child: Child,
    lines: Receiver<String>,
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts this executable as `role`.
    pub fn spawn(role: Role, arguments: &[&str]) -> Result<Self, ChildError> {
        let failed = |error| ChildError::Spawn { role: role.name(), error };
        let mut child = Command::new(std::env::current_exe().map_err(failed)?)
            .arg(role.name())
            .args(arguments)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .map_err(failed)?;
        let output = child.stdout.take().expect("standard output is piped");
        let (sender, lines) = channel();
        thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Ok(Self { role, child, lines, status: None })
    }

    /// Its role.
    pub fn role(&self) -> Role {
        self.role
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits until it reports that it is ready; none if `is_cancelled` becomes true first.
    pub fn wait_ready(&mut self, is_cancelled: impl Fn() -> bool) -> Result<Option<Ready>, ChildError> {
        let not_ready = |reason: String| ChildError::NotReady { role: self.role.name(), reason };
        let mut polls = READY_TIMEOUT.as_millis() / POLL.as_millis();
        loop {
            match self.lines.recv_timeout(POLL) {
                Ok(line) => {
                    let ready = serde_json::from_str(&line);
                    return ready.map(Some).map_err(|error| not_ready(format!("{error} in '{line}'")));
                }
                // Ctrl-C also reaches the process, and may end it before it handles signals.
                Err(_) if is_cancelled() => return Ok(None),
                Err(RecvTimeoutError::Timeout) if polls > 0 => polls -= 1,
                Err(RecvTimeoutError::Timeout) => {
                    return Err(not_ready(format!("no report within {} s", READY_TIMEOUT.as_secs())));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(not_ready("it ended; see its message above".to_owned()));
                }
            }
        }
    }

    /// Starts its work.
    pub fn start(&mut self, start: Start) -> io::Result<()> {
        let input = self.child.stdin.as_mut().expect("standard input is piped");
        serde_json::to_writer(&mut *input, &start)?;
        writeln!(input)
    }

    /// Its exit status, if it has ended.
    pub fn exit_status(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            self.status = self.child.try_wait()?;
        }
        Ok(self.status)
    }

    /// Asks it to end (SIGTERM).
    pub fn terminate(&mut self) {
        self.signal(Signal::TERM);
    }

    /// Ends it at once (SIGKILL).
    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
    }

    fn signal(&mut self, signal: Signal) {
        if matches!(self.exit_status(), Ok(None)) {
            // If it ends between the two calls, no signal is needed.
            let _ = kill_process(Pid::from_child(&self.child), signal);
        }
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
        let _ = self.child.wait();
    }
}

/// An exit status as text.
pub fn describe(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("signal");
            format!("{name} ({signal})")
        }
        (None, None) => "unknown status".to_owned(),
    }
}
