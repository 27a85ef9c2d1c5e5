//! A process of the rig as its supervisor sees it.

use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use masseter_shared::lifecycle::{Ready, Start};
use rustix::process::{Pid, Signal, kill_process};

/// How long a process may take to open its ports and lock its memory.
const READY_WITHIN: Duration = Duration::from_secs(20);

/// How often a wait looks whether it is still wanted.
const LOOK: Duration = Duration::from_millis(20);

/// Which process it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// The controller.
    Controller,
    /// The plant.
    Plant,
    /// The logger.
    Logger,
}

impl Role {
    /// The hidden subcommand, which is also its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Controller => "controller",
            Self::Plant => "plant",
            Self::Logger => "logger",
        }
    }
}

/// Why a process did not come up.
#[derive(Debug, thiserror::Error)]
pub enum ChildError {
    /// It could not be started, or its pipes failed.
    #[error("the {role} cannot be started: {error}")]
    Spawn {
        /// Which.
        role: &'static str,
        /// What the system said.
        error: io::Error,
    },
    /// It ended or kept silent instead of reporting ready.
    #[error("the {role} did not get ready: {reason}")]
    NotReady {
        /// Which.
        role: &'static str,
        /// What it did instead.
        reason: String,
    },
}

/// A running process. Dropping it kills what still runs.
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

    /// Which process it is.
    pub fn role(&self) -> Role {
        self.role
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits until it says that it is ready; none when `is_given_up` comes first.
    pub fn wait_ready(&mut self, is_given_up: impl Fn() -> bool) -> Result<Option<Ready>, ChildError> {
        let not_ready = |reason: String| ChildError::NotReady { role: self.role.name(), reason };
        let mut looks = READY_WITHIN.as_millis() / LOOK.as_millis();
        loop {
            match self.lines.recv_timeout(LOOK) {
                Ok(line) => {
                    let ready = serde_json::from_str(&line);
                    return ready.map(Some).map_err(|error| not_ready(format!("{error} in '{line}'")));
                }
                // A key on the terminal reaches it as well, before it listens for signals.
                Err(_) if is_given_up() => return Ok(None),
                Err(RecvTimeoutError::Timeout) if looks > 0 => looks -= 1,
                Err(RecvTimeoutError::Timeout) => {
                    return Err(not_ready(format!("silent for {} s", READY_WITHIN.as_secs())));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(not_ready("it ended; its message stands above".to_owned()));
                }
            }
        }
    }

    /// Gives the word to begin.
    pub fn start(&mut self, start: Start) -> io::Result<()> {
        let input = self.child.stdin.as_mut().expect("standard input is piped");
        serde_json::to_writer(&mut *input, &start)?;
        writeln!(input)
    }

    /// How it ended, if it did.
    pub fn ended(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            self.status = self.child.try_wait()?;
        }
        Ok(self.status)
    }

    /// Asks it to end in order.
    pub fn terminate(&mut self) {
        self.signal(Signal::TERM);
    }

    /// Ends it at once.
    pub fn kill(&mut self) {
        self.signal(Signal::KILL);
    }

    fn signal(&mut self, signal: Signal) {
        if matches!(self.ended(), Ok(None)) {
            // It may end between the two calls; then there is nobody left to signal.
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

/// An exit status in words.
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
