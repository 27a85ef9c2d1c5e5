//! A child process of the supervisor: start, readiness, end. It does not decide what its end means for the run.

use std::ffi::OsString;
use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_runtime::clock;
use masseter_runtime::lifecycle::{Order, Party, Silence, Start, line};
use rustix::process::{
    Pid, PidfdFlags, Resource, Rlimit, Signal, getrlimit, kill_process, pidfd_open, prlimit,
};

use super::reports::{Due, Readiness, Ready, Reports};
use crate::interrupts::Interrupts;

/// Longest time for a process to open its ports and lock its memory.
pub(super) const READY_TIMEOUT: Duration = Duration::from_secs(20);

/// Polling interval while waiting for readiness.
pub(super) const POLL: Duration = Duration::from_millis(20);

/// Polling interval while waiting for the end.
const END_POLL: Duration = Duration::from_millis(2);

/// What became of a process that the rig ended.
pub(super) const KILLED: &str = "was killed";

// The names of the processes, which are also their subcommands.
pub(super) const CONTROLLER: &str = Party::Controller.name();
pub(super) const PLANT: &str = Party::Plant.name();
pub(super) const RECORDER: &str = Party::Recorder.name();

/// A process; killed when dropped.
pub(super) struct Process {
    /// Its name.
    pub(super) role: &'static str,
    child: Child,
    reports: Reports,
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts this executable as `role`.
    pub(super) fn spawn(role: &'static str, arguments: &[OsString]) -> anyhow::Result<Self> {
        let mut child = std::env::current_exe()
            .and_then(|executable| {
                Command::new(executable)
                    .arg(role)
                    .args(arguments)
                    .stdin(Stdio::piped())
                    .stdout(Stdio::piped())
                    .spawn()
            })
            .with_context(|| format!("the {role} cannot be started"))?;
        let output = child.stdout.take().expect("standard output is piped");
        Ok(Self { role, child, reports: Reports::of(output.into())?, status: None })
    }

    /// Its process id.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Waits until it reports that it is ready; none if `is_cancelled` becomes true first.
    pub(super) fn wait_ready(&mut self, is_cancelled: impl Fn() -> bool) -> anyhow::Result<Option<Ready>> {
        let not_ready = || format!("the {} did not get ready", self.role);
        for _ in 0..READY_TIMEOUT.as_millis() / POLL.as_millis() {
            match self.reports.await_ready(POLL) {
                Readiness::Ready(ready) => return Ok(Some(ready)),
                // Ctrl-C also reaches the process, and may end it before it handles signals.
                _ if is_cancelled() => return Ok(None),
                Readiness::NotYet => {}
                Readiness::Refused(refusal) => bail!("{}: {refusal}", not_ready()),
                Readiness::Closed => bail!("{}: it ended; see its message above", not_ready()),
            }
        }
        bail!("{}: no report within {} s", not_ready(), READY_TIMEOUT.as_secs())
    }

    /// Starts its work.
    pub(super) fn start(&mut self, start: &Start) -> io::Result<()> {
        let input = self.child.stdin.as_mut().expect("standard input is piped");
        input.write_all(line(&Order::Start(start.clone())).as_bytes())
    }

    /// Its report that another process was silent, if it has made one.
    pub(super) fn reported_silence(&mut self) -> Option<Silence> {
        self.reports.silence()
    }

    /// Its next report that a fault is due.
    pub(super) fn due(&mut self) -> Option<Due> {
        self.reports.due()
    }

    /// Tells it that the fault has struck.
    pub(super) fn go_on(&mut self) {
        let input = self.child.stdin.as_mut().expect("standard input is piped");
        // It may have ended.
        let _ = input.write_all(line(&Order::Struck).as_bytes());
    }

    /// Its process file, which stays its own whatever becomes of the id.
    pub(super) fn handle(&self) -> io::Result<OwnedFd> {
        open_handle(&self.child)
    }

    /// Lets its files grow no further than to this length, in bytes.
    pub(super) fn limit_files(&self, bytes: u64) -> io::Result<()> {
        let limit = Rlimit { current: Some(bytes), ..getrlimit(Resource::Fsize) };
        prlimit(Some(Pid::from_child(&self.child)), Resource::Fsize, limit)?;
        Ok(())
    }

    /// Its exit status, if it has ended.
    pub(super) fn exit_status(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() {
            self.status = self.child.try_wait()?;
        }
        Ok(self.status)
    }

    /// Asks it to end (SIGTERM).
    pub(super) fn terminate(&mut self) {
        self.signal(Signal::TERM);
    }

    /// Asks the process to end, and kills it if it does not end in time; its status if it did.
    pub(super) fn end(&mut self, timeout_ns: u64, interrupts: &Interrupts) -> io::Result<Option<ExitStatus>> {
        self.terminate();
        let status = self.await_end(timeout_ns, interrupts)?;
        if status.is_none() {
            self.kill();
        }
        Ok(status)
    }

    /// Waits for its end; its exit status, if it ends in time and before an immediate end is requested.
    pub(super) fn await_end(
        &mut self,
        timeout_ns: u64,
        interrupts: &Interrupts,
    ) -> io::Result<Option<ExitStatus>> {
        let deadline_ns = clock::now_ns() + timeout_ns;
        loop {
            let status = self.exit_status()?;
            if status.is_some() || interrupts.is_abort_requested() || clock::now_ns() >= deadline_ns {
                return Ok(status);
            }
            clock::sleep(END_POLL);
        }
    }

    /// Ends it at once (SIGKILL).
    pub(super) fn kill(&mut self) {
        self.signal(Signal::KILL);
    }

    /// The same; returns what became of it, in words.
    pub(super) fn give_up(&mut self) -> &'static str {
        self.kill();
        KILLED
    }

    /// That it has ended before the start, in words, if it has.
    pub(super) fn death(&mut self) -> Option<String> {
        let status = self.exit_status().ok()??;
        Some(format!("the {} ended ({}) before the start", self.role, describe(status)))
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

/// The process file of a child.
pub(super) fn open_handle(child: &Child) -> io::Result<OwnedFd> {
    Ok(pidfd_open(Pid::from_child(child), PidfdFlags::empty())?)
}

/// An exit status as text.
pub(super) fn describe(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("signal");
            format!("{name} ({signal})")
        }
        (None, None) => "unknown status".to_owned(),
    }
}
