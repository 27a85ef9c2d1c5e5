//! A program of the user as the controller: admitted over the domain's socket, and watched until it ends.
//!
//! An executable is started and, if it does not end in time, killed; the kernel kills it if the supervisor dies. A
//! program that the user starts by hand, perhaps under a debugger, is waited for and never killed. The rig admits one
//! program; it refuses any other with the reason.

use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Write};
use std::net::Shutdown;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::net::{UnixListener, UnixStream};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_shared::clock;
use masseter_shared::lifecycle::attach::{Answer, Hello, Invitation, RIG_VARIABLE, socket};
use masseter_shared::lifecycle::{End, Order, Silence, Start, line};
use masseter_shared::transport::Domain;
use masseter_terminal::status;
use rustix::net::sockopt::socket_peercred;
use rustix::process::{Pid, Signal, WaitId, WaitIdOptions, kill_process_group, waitid};

use super::child::{KILLED, POLL, READY_TIMEOUT, describe, open_handle};
use super::exec_program::tied_to_this_process;
use super::reports::{Due, Readiness, Ready, Reports};

/// Longest wait for the greeting of a program that has connected.
const HELLO_TIMEOUT: Duration = Duration::from_millis(500);
/// Longest wait for an executable to end by itself after its work.
const EXIT_TIMEOUT: Duration = Duration::from_secs(5);

/// A program that is, or will be, the controller.
pub(super) struct Program {
    rig: String,
    listener: UnixListener,
    invitation: Invitation,
    executable: Option<Executable>,
    admitted: Option<Admitted>,
}

struct Executable {
    path: PathBuf,
    child: Child,
    status: Option<ExitStatus>,
}

struct Admitted {
    stream: UnixStream,
    process_id: u32,
    reports: Reports,
}

impl Executable {
    /// Its exit status once it has ended. Its process group is killed first, before the number can be another's: a
    /// script may leave the controller behind.
    fn exit_status(&mut self) -> io::Result<Option<ExitStatus>> {
        if self.status.is_none() && self.is_zombie()? {
            self.kill_group();
            self.status = Some(self.child.wait()?);
        }
        Ok(self.status)
    }

    /// Whether it has ended and nobody has waited for it.
    fn is_zombie(&self) -> io::Result<bool> {
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        Ok(waitid(WaitId::Pid(Pid::from_child(&self.child)), options)?.is_some())
    }

    /// Kills it, with what it has started; whether it still ran.
    fn kill(&mut self) -> bool {
        if self.status.is_some() {
            return false;
        }
        self.kill_group();
        self.child.kill().is_ok()
    }

    fn kill_group(&self) {
        // It may have left its group.
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
    }
}

impl Program {
    /// Listens for a program that the user starts.
    pub(super) fn external(domain: &Domain, invitation: Invitation) -> anyhow::Result<Self> {
        let path = socket(domain);
        let listen = || {
            let listener = UnixListener::bind(&path)?;
            listener.set_nonblocking(true)?;
            Ok::<_, io::Error>(listener)
        };
        let listener = listen().with_context(|| format!("cannot listen at {}", path.display()))?;
        Ok(Self { rig: domain.id().to_owned(), listener, invitation, executable: None, admitted: None })
    }

    /// Starts an executable, and listens for it. Its standard output goes to standard error, since the rig's own is the
    /// result.
    pub(super) fn executable(domain: &Domain, invitation: Invitation, path: &Path) -> anyhow::Result<Self> {
        let mut program = Self::external(domain, invitation)?;
        let output = io::stderr().as_fd().try_clone_to_owned().context("standard error cannot be shared")?;
        // It ends with the supervisor's main thread, which is this one.
        let child = tied_to_this_process(path)
            .and_then(|mut command| {
                command
                    .env(RIG_VARIABLE, domain.id())
                    .stdin(Stdio::null())
                    .stdout(File::from(output))
                    // A terminal's Ctrl-C is for the rig, which then asks the program to end.
                    .process_group(0)
                    .spawn()
            })
            .with_context(|| format!("the controller {} cannot be started", path.display()))?;
        program.executable = Some(Executable { path: path.to_owned(), child, status: None });
        Ok(program)
    }

    /// Its process id; 0 before it is admitted, or from another container.
    pub(super) fn id(&self) -> u32 {
        self.admitted.as_ref().map_or(0, |admitted| admitted.process_id)
    }

    /// Waits until the program has attached and is ready; none if `is_cancelled` becomes true first. Fails once another
    /// process has died.
    pub(super) fn wait_ready(
        &mut self,
        is_cancelled: impl Fn() -> bool,
        mut has_died: impl FnMut() -> Option<String>,
    ) -> anyhow::Result<Option<Ready>> {
        if self.executable.is_none() {
            status!(
                "waiting for a controller: start yours with {RIG_VARIABLE}={}; Ctrl-C gives up",
                self.rig
            );
        }
        let mut polls = READY_TIMEOUT.as_millis() / POLL.as_millis();
        loop {
            match self.await_readiness()? {
                Readiness::Ready(ready) => return Ok(Some(ready)),
                _ if is_cancelled() => return Ok(None),
                // The user may correct it and start it again.
                Readiness::Closed if self.executable.is_none() => {
                    status!("the controller ended before it was ready; waiting for the next");
                    self.admitted = None;
                }
                Readiness::Closed => bail!("the controller ended before it was ready; see its message above"),
                Readiness::NotYet => polls = polls.saturating_sub(1),
            }
            if let Some(death) = has_died() {
                bail!(death);
            }
            self.check_executable(polls > 0)?;
        }
    }

    fn await_readiness(&mut self) -> anyhow::Result<Readiness> {
        self.admit()?;
        if let Some(admitted) = &mut self.admitted {
            return admitted.reports.await_ready(POLL).context("the controller did not get ready");
        }
        clock::sleep(POLL);
        Ok(Readiness::NotYet)
    }

    /// Refuses an executable that has ended or has taken too long.
    fn check_executable(&mut self, is_in_time: bool) -> anyhow::Result<()> {
        let Some(executable) = &mut self.executable else { return Ok(()) };
        let status = executable.exit_status()?;
        let path = executable.path.display();
        if let Some(status) = status {
            bail!(
                "the controller {path} ended ({}) before it was ready; see its message above, and docs/interface.md for \
                 how a controller attaches",
                describe(status)
            );
        }
        if !is_in_time {
            bail!(
                "the controller {path} is not ready after {} s: does it attach to the rig that {RIG_VARIABLE} names? To \
                 start it by hand, use --controller external",
                READY_TIMEOUT.as_secs()
            );
        }
        Ok(())
    }

    /// Answers the programs that have connected: admits the first one, refuses every other.
    pub(super) fn admit(&mut self) -> io::Result<()> {
        loop {
            let stream = match self.listener.accept() {
                Ok((stream, _)) => stream,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(()),
                Err(error) => return Err(error),
            };
            // A program that does not greet, or is gone, is none.
            let Ok(hello) = receive_hello(&stream) else { continue };
            let answer = self.answer(hello.as_ref());
            let is_admitted = matches!(answer, Answer::Invited(_));
            if let Answer::Refused { reason } = &answer {
                status!("masseter: a program that attaches to '{}' is refused: {reason}", self.rig);
            }
            if (&stream).write_all(line(&answer).as_bytes()).is_ok() && is_admitted {
                let process_id = socket_peercred(&stream)
                    .map_or(0, |peer| peer.pid.as_raw_nonzero().get().cast_unsigned());
                let reports = Reports::of(stream.try_clone()?.into());
                self.admitted = Some(Admitted { stream, process_id, reports });
            }
        }
    }

    fn answer(&self, hello: Option<&Hello>) -> Answer {
        let refused = |reason| Answer::Refused { reason };
        let Some(hello) = hello else {
            return refused("its greeting is not that of a controller of this version".to_owned());
        };
        if let Some((theirs, own)) = hello.difference() {
            return refused(format!(
                "it uses the message '{theirs}', the rig '{own}': build it against this version of Masseter"
            ));
        }
        match &self.admitted {
            Some(first) => refused(format!(
                "the rig has its controller, process {}: stop that one, or start another rig",
                first.process_id
            )),
            None => Answer::Invited(self.invitation.clone()),
        }
    }

    /// Starts its work.
    pub(super) fn start(&mut self, start: &Start) -> io::Result<()> {
        self.order(&Order::Start(start.clone()))
    }

    /// Asks it to end. A program whose line is closed has ended.
    pub(super) fn terminate(&mut self) {
        let _ = self.order(&Order::Stop);
    }

    fn order(&mut self, order: &Order) -> io::Result<()> {
        let Some(admitted) = &self.admitted else { return Ok(()) };
        (&admitted.stream).write_all(line(order).as_bytes())
    }

    /// Its report that another process was silent, if it has made one.
    pub(super) fn reported_silence(&mut self) -> Option<Silence> {
        self.admitted.as_mut()?.reports.silence()
    }

    /// Its next report that a fault is due.
    pub(super) fn due(&mut self) -> Option<Due> {
        self.admitted.as_mut()?.reports.due()
    }

    /// Tells it that the fault has struck. It may have ended.
    pub(super) fn go_on(&mut self) {
        let _ = self.order(&Order::Struck);
    }

    /// The process file of an executable of the rig.
    pub(super) fn handle(&self) -> io::Result<Option<OwnedFd>> {
        let open = |executable: &Executable| open_handle(&executable.child);
        self.executable.as_ref().map(open).transpose()
    }

    /// Kills an executable of the rig; whether it did.
    pub(super) fn kill(&mut self) -> bool {
        self.executable.as_mut().is_some_and(Executable::kill)
    }

    /// How the program ended its work; none while it works. It has failed where it gives no report.
    pub(super) fn end(&mut self) -> io::Result<Option<End>> {
        self.admit()?;
        let Some(Admitted { reports, .. }) = &mut self.admitted else { return Ok(None) };
        // The reports come before the end of the line.
        let is_closed = reports.is_closed();
        Ok(match reports.end() {
            None if is_closed => Some(End::Failed { reason: self.exit()? }),
            end => end,
        })
    }

    /// How the process ended, which gives no report any more.
    fn exit(&mut self) -> io::Result<String> {
        let exited = self.await_exit()?;
        Ok(exited.map_or_else(|| "it left the rig without a report".to_owned(), describe))
    }

    /// The exit status of an executable, if it ends in time.
    fn await_exit(&mut self) -> io::Result<Option<ExitStatus>> {
        let Some(executable) = &mut self.executable else { return Ok(None) };
        for _ in 0..EXIT_TIMEOUT.as_millis() / POLL.as_millis() {
            if let Some(status) = executable.exit_status()? {
                return Ok(Some(status));
            }
            clock::sleep(POLL);
        }
        Ok(None)
    }

    /// Closes the line, and ends an executable at once (SIGKILL); returns what became of the program, in words.
    pub(super) fn give_up(&mut self) -> &'static str {
        self.close();
        let Some(executable) = &mut self.executable else { return "was left to its user" };
        executable.kill();
        KILLED
    }

    /// Closes the line, by which the program notices that the rig is gone.
    fn close(&mut self) {
        if let Some(admitted) = &self.admitted {
            // The program may have closed it before.
            let _ = admitted.stream.shutdown(Shutdown::Both);
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.close();
        let _ = self.await_exit();
        self.give_up();
        if let Some(Executable { child, .. }) = &mut self.executable {
            let _ = child.wait();
        }
    }
}

/// The greeting of a program; none if it is not one.
fn receive_hello(stream: &UnixStream) -> io::Result<Option<Hello>> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(HELLO_TIMEOUT))?;
    let mut text = String::new();
    // The program sends nothing more before the answer, so nothing is lost in this buffer.
    BufReader::new(io::Read::take(stream, 4096)).read_line(&mut text)?;
    stream.set_read_timeout(None)?;
    if text.is_empty() {
        return Err(ErrorKind::UnexpectedEof.into());
    }
    Ok(serde_json::from_str(&text).ok())
}
