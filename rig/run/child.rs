//! A child process of the supervisor: start, readiness, reports, end. What a report or an end means for the run is not
//! decided here.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_runtime::conversation::{Conversation, Left, Limits, line};
use masseter_runtime::lifecycle::{End, Order, Party, Report, Silence};
use masseter_runtime::{clock, named::Declared, realtime::scheduling::Obtained};
use masseter_virtual_time::Requests;
use rustix::process::{
    Pid, PidfdFlags, Resource, Rlimit, Signal, getrlimit, kill_process, pidfd_open, prlimit,
};

use super::interrupts::Interrupts;

/// Longest time for a process to open its ports and lock its memory.
pub(super) const READY_TIMEOUT: Duration = Duration::from_secs(20);

/// Polling interval while waiting for readiness.
pub(super) const POLL: Duration = Duration::from_millis(20);

/// Polling interval while waiting for the end.
const END_POLL: Duration = Duration::from_millis(2);

/// What became of a process that the rig ended.
pub(super) const KILLED: &str = "was killed";

/// Bytes of all reports of a process: a declaration, a fault that is due now and then, and an end.
const MOST_BYTES: usize = 1 << 20;

// The names of the processes, which are also their subcommands.
pub(super) const CONTROLLER: &str = Party::Controller.name();
pub(super) const PLANT: &str = Party::Plant.name();
pub(super) const RECORDER: &str = Party::Recorder.name();

/// A process; killed when dropped.
pub(super) struct Process {
    /// Its name.
    pub(super) role: &'static str,
    child: Child,
    pub(super) reports: Reports,
    status: Option<ExitStatus>,
}

impl Process {
    /// Starts this executable as `role`.
    pub(super) fn spawn(role: &'static str, arguments: &[std::ffi::OsString]) -> anyhow::Result<Self> {
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

    /// Sends it an order.
    pub(super) fn order(&mut self, order: &Order) -> io::Result<()> {
        let input = self.child.stdin.as_mut().expect("standard input is piped");
        input.write_all(line(order).as_bytes())
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

    /// Ends it at once; returns what became of it, in words.
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

/// The reports that were read and not yet looked at, and those that matter until the end.
///
/// They are read where they are looked at: a report that was made before is seen.
pub(super) struct Reports {
    conversation: Conversation,
    silence: Option<Silence>,
    due: VecDeque<Due>,
    end: Option<End>,
    left: Option<Left>,
}

/// The report of a process that is ready.
pub(super) struct Ready {
    pub(super) scheduling: Obtained,
    /// Of the controller.
    pub(super) declared: Declared,
}

/// A fault of a process that is due.
#[derive(Debug, Clone, Copy)]
pub(super) struct Due {
    /// Its place in the scenario's list.
    pub(super) fault: usize,
    /// When it became due, ns of the run's clock.
    pub(super) now_ns: u64,
}

/// The next step on the way to readiness.
pub(super) enum Readiness {
    Ready(Ready),
    NotYet,
    /// Its report cannot be recorded or shown, or it has broken a limit of the line.
    Refused(String),
    /// The process has closed the line.
    Closed,
}

impl Reports {
    /// The reports that the process writes into `input`.
    pub(super) fn of(input: OwnedFd) -> io::Result<Self> {
        let now_ns = clock::now_ns();
        Ok(Self::over(Conversation::begin(input, Limits::admitted(MOST_BYTES), now_ns)?))
    }

    /// The reports of a program that was admitted.
    pub(super) fn of_admitted(mut conversation: Conversation) -> Self {
        conversation.renew(Limits::admitted(MOST_BYTES), clock::now_ns());
        Self::over(conversation)
    }

    fn over(conversation: Conversation) -> Self {
        Self { conversation, silence: None, due: VecDeque::new(), end: None, left: None }
    }

    /// Sends an order to a program. A program that does not read its orders is out.
    pub(super) fn order(&mut self, order: &Order) {
        self.conversation.say(line(order).as_bytes());
    }

    /// Closes the line, by which a program notices that the rig is gone.
    pub(super) fn close(&self) {
        self.conversation.close();
    }

    /// Waits for the report of readiness, for at most this time.
    pub(super) fn await_ready(&mut self, timeout: Duration) -> Readiness {
        let mut line = self.conversation.next_line();
        if line.is_none() {
            self.conversation.wait(timeout);
            self.conversation.hear();
            line = self.conversation.next_line();
        }
        let Some(line) = line else {
            self.has_left();
            return match &self.left {
                None => Readiness::NotYet,
                Some(Left::Closed) => Readiness::Closed,
                Some(left) => Readiness::Refused(left.to_string()),
            };
        };
        match Report::read(&line) {
            Ok(Report::Ready { scheduling, declared }) => Readiness::Ready(Ready { scheduling, declared }),
            Ok(Report::Ended(end)) => {
                self.end = Some(end);
                Readiness::Closed
            }
            Ok(report) => {
                self.keep(report);
                Readiness::NotYet
            }
            Err(refusal) => Readiness::Refused(refusal.to_string()),
        }
    }

    /// The report that another process was silent, if there is one.
    pub(super) fn silence(&mut self) -> Option<Silence> {
        self.look();
        self.silence.take()
    }

    /// The next report that a fault is due.
    pub(super) fn due(&mut self) -> Option<Due> {
        self.look();
        self.due.pop_front()
    }

    /// How the program ended its work, if it has reported that.
    pub(super) fn end(&mut self) -> Option<End> {
        self.look();
        self.end.clone()
    }

    /// Why the process reports nothing more; none while it can.
    pub(super) fn left(&mut self) -> Option<&Left> {
        self.look();
        self.has_left();
        self.left.as_ref()
    }

    fn has_left(&mut self) -> bool {
        if self.left.is_none() {
            self.left = self.conversation.left(clock::now_ns());
        }
        self.left.is_some()
    }

    fn look(&mut self) {
        self.conversation.hear();
        while let Some(line) = self.conversation.next_line() {
            match Report::read(&line) {
                Ok(report) => self.keep(report),
                // The first one counts: whoever reports what cannot be is no controller.
                Err(refusal) => {
                    let reason = format!("its report is refused: {refusal}");
                    self.end.get_or_insert(End::Failed { reason });
                }
            }
        }
    }

    fn keep(&mut self, report: Report) {
        match report {
            Report::Silence(silence) => self.silence = Some(silence),
            Report::Due { fault, now_ns } => self.due.push_back(Due { fault, now_ns }),
            Report::Ended(end) => drop(self.end.get_or_insert(end)),
            Report::Ready { .. } => {}
        }
    }
}
