//! A program of the user as the controller, admitted over the domain's socket and watched until it ends.
//!
//! An executable is started and, if it does not end in time, killed; the kernel kills it if the supervisor dies. A
//! program that the user starts by hand, perhaps under a debugger, is waited for and never killed. The rig admits one
//! program; it refuses any other with the reason.

use std::os::fd::{AsFd, OwnedFd};
use std::process::{self, Child, Command, ExitStatus, Stdio};
use std::{ffi::OsString, fs::File, io, os::unix::process::CommandExt};

use masseter_runtime::lifecycle::attach::{Invitation, RIG_VARIABLE};
use masseter_runtime::lifecycle::{End, Order};
use masseter_runtime::{conversation::Left, transport::Domain};
use rustix::process::{
    Pid, Signal, WaitId, WaitIdOptions, getppid, kill_process_group, set_parent_process_death_signal, waitid,
};

use super::child::{KILLED, POLL, READY_TIMEOUT, Readiness, Ready, Reports, describe, open_handle};
use super::reception::Reception;
use super::request::is_fmu_player;
use crate::prelude::*;

/// The hidden verb that ties a process to the supervisor before it becomes the program.
const EXEC_VERB: &str = "exec-program";
/// Longest wait for an executable to end by itself after its work.
const EXIT_TIMEOUT_NS: u64 = 5 * masseter_runtime::clock::SECOND_NS;

/// A program that is, or will be, the controller.
pub(super) struct Program {
    reception: Reception,
    executable: Option<Executable>,
    admitted: Option<Admitted>,
}

struct Executable {
    path: PathBuf,
    /// What it needs, for one that ends before it is ready.
    guide: &'static str,
    child: Child,
    status: Option<ExitStatus>,
}

struct Admitted {
    process_id: u32,
    reports: Reports,
    /// Once its line is closed without a report: until when its exit status is awaited.
    exit_by_ns: Option<u64>,
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
        Ok(Self { reception: Reception::open(domain, invitation)?, executable: None, admitted: None })
    }

    /// Starts an executable, and listens for it. Its standard output goes to standard error, since the rig's own is the
    /// result.
    pub(super) fn executable(
        domain: &Domain,
        invitation: Invitation,
        path: &Path,
        arguments: &[String],
    ) -> anyhow::Result<Self> {
        let mut program = Self::external(domain, invitation)?;
        let output = io::stderr().as_fd().try_clone_to_owned().context("standard error cannot be shared")?;
        // It ends with the supervisor's main thread, which is this one.
        let child = tied_to_this_process(path)
            .and_then(|mut command| {
                command
                    .args(arguments)
                    .env(RIG_VARIABLE, domain.id())
                    .stdin(Stdio::null())
                    .stdout(File::from(output))
                    // A terminal's Ctrl-C is for the rig, which then asks the program to end.
                    .process_group(0)
                    .spawn()
            })
            .with_context(|| format!("the controller {} cannot be started", path.display()))?;
        let guide = if is_fmu_player(arguments) {
            "docs/fmu.md for the Python package that plays an FMU"
        } else {
            "docs/interface.md for how a controller attaches"
        };
        program.executable = Some(Executable { path: path.to_owned(), guide, child, status: None });
        Ok(program)
    }

    /// Its process id; 0 before it is admitted, or from another container.
    pub(super) fn id(&self) -> u32 {
        self.admitted.as_ref().map_or(0, |admitted| admitted.process_id)
    }

    /// Its reports; none before it is admitted.
    pub(super) fn reports(&mut self) -> Option<&mut Reports> {
        self.admitted.as_mut().map(|admitted| &mut admitted.reports)
    }

    /// Its process file; `None` if the rig has not started it.
    pub(super) fn handle(&self) -> io::Result<Option<OwnedFd>> {
        self.executable.as_ref().map(|executable| open_handle(&executable.child)).transpose()
    }

    /// Kills an executable (SIGKILL); whether it still ran.
    pub(super) fn kill(&mut self) -> bool {
        self.executable.as_mut().is_some_and(Executable::kill)
    }

    /// Whether it has left without a report, though its exit status is not known yet.
    pub(super) fn has_left(&self) -> bool {
        self.admitted.as_ref().is_some_and(|admitted| admitted.exit_by_ns.is_some())
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
                self.reception.rig()
            );
        }
        let ready_by_ns = clock::now_ns() + READY_TIMEOUT.as_nanos() as u64;
        loop {
            match self.await_readiness() {
                Readiness::Ready(ready) => return Ok(Some(ready)),
                _ if is_cancelled() => return Ok(None),
                // The user may correct it and start it again.
                Readiness::Closed if self.executable.is_none() => {
                    self.reception
                        .count_refusal("it ended before it was ready; the rig waits for the next".to_owned());
                    self.admitted = None;
                }
                Readiness::Closed => bail!("the controller ended before it was ready; see its message above"),
                Readiness::Refused(refusal) => self.send_away(&refusal)?,
                Readiness::NotYet => {}
            }
            if let Some(death) = has_died() {
                bail!(death);
            }
            self.check_executable(clock::now_ns() < ready_by_ns)?;
        }
    }

    fn await_readiness(&mut self) -> Readiness {
        self.admit();
        if let Some(admitted) = &mut self.admitted {
            return admitted.reports.await_ready(POLL);
        }
        clock::sleep(POLL);
        Readiness::NotYet
    }

    /// Tells a program why the rig does not take it. The user of one that was started by hand may correct it.
    fn send_away(&mut self, refusal: &str) -> anyhow::Result<()> {
        self.order(&Order::Refused { reason: refusal.to_owned() });
        self.close();
        self.admitted = None;
        match &self.executable {
            Some(Executable { path, .. }) => bail!("the controller {} is refused: {refusal}", path.display()),
            None => self.reception.count_refusal(format!("{refusal}; the rig waits for the next")),
        }
        Ok(())
    }

    /// Refuses an executable that has ended or has taken too long.
    fn check_executable(&mut self, is_in_time: bool) -> anyhow::Result<()> {
        let Some(executable) = &mut self.executable else { return Ok(()) };
        let status = executable.exit_status()?;
        let path = executable.path.display();
        if let Some(status) = status {
            bail!(
                "the controller {path} ended ({}) before it was ready; see its message above, and {}",
                describe(status),
                executable.guide
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
    fn admit(&mut self) {
        let controller = self.admitted.as_ref().map(|admitted| admitted.process_id);
        if let Some(conversation) = self.reception.admit(controller) {
            let process_id = rustix::net::sockopt::socket_peercred(&conversation)
                .map_or(0, |peer| peer.pid.as_raw_nonzero().get().cast_unsigned());
            let reports = Reports::of_admitted(conversation);
            self.admitted = Some(Admitted { process_id, reports, exit_by_ns: None });
        }
    }

    pub(super) fn order(&mut self, order: &Order) {
        if let Some(admitted) = &mut self.admitted {
            admitted.reports.order(order);
        }
    }

    /// How the program ended its work; none while it works. It has failed where it gives no report. Never waits.
    pub(super) fn end(&mut self) -> io::Result<Option<End>> {
        self.admit();
        let Some(Admitted { reports, exit_by_ns, .. }) = &mut self.admitted else { return Ok(None) };
        // The reports come before the end of the line.
        let left = reports.left().map(without_report);
        let end = reports.end();
        if left.is_some() || matches!(end, Some(End::Failed { .. })) {
            // Whoever has failed or broken a limit commands the drives no longer.
            reports.close();
        }
        if end.is_some() {
            return Ok(end);
        }
        let Some(left) = left else { return Ok(None) };
        let now_ns = clock::now_ns();
        let exit_by_ns = *exit_by_ns.get_or_insert(now_ns + EXIT_TIMEOUT_NS);
        let Some(executable) = &mut self.executable else { return Ok(Some(End::Failed { reason: left })) };
        let exited = executable.exit_status()?.map(describe);
        Ok(exited.or_else(|| (now_ns >= exit_by_ns).then_some(left)).map(|reason| End::Failed { reason }))
    }

    /// Waits until an executable has ended, for a limited time.
    fn await_exit(&mut self) {
        let Some(executable) = &mut self.executable else { return };
        let exit_by_ns = clock::now_ns() + EXIT_TIMEOUT_NS;
        while matches!(executable.exit_status(), Ok(None)) && clock::now_ns() < exit_by_ns {
            clock::sleep(POLL);
        }
    }

    /// Closes the line, and ends an executable at once (SIGKILL); returns what became of the program, in words.
    pub(super) fn give_up(&mut self) -> &'static str {
        self.close();
        let Some(executable) = &mut self.executable else { return "was left to its user" };
        executable.kill();
        KILLED
    }

    /// Closes the line, by which the program notices that the rig is gone.
    fn close(&self) {
        if let Some(admitted) = &self.admitted {
            admitted.reports.close();
        }
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.close();
        self.await_exit();
        self.give_up();
        if let Some(Executable { child, .. }) = &mut self.executable {
            let _ = child.wait();
        }
    }
}

/// The words for a program that reports nothing more.
fn without_report(left: &Left) -> String {
    match left {
        Left::Closed => "it left the rig without a report".to_owned(),
        left => format!("the rig closed its line: {left}"),
    }
}

/// The command that starts the program at `path`, and ends it with the thread that spawns it.
fn tied_to_this_process(path: &Path) -> io::Result<Command> {
    let mut command = Command::new(std::env::current_exe()?);
    command.args([EXEC_VERB, &process::id().to_string(), "--"]).arg(path);
    Ok(command)
}

/// Lets the kernel kill this process when its parent dies.
///
/// # Errors
/// When the parent is another one already: its death would give no signal any more.
pub(crate) fn end_with_parent(parent: Option<Pid>) -> anyhow::Result<()> {
    set_parent_process_death_signal(Some(Signal::KILL))
        .context("the process cannot be tied to its parent")?;
    ensure!(getppid() == parent, "the process that started this one is gone");
    Ok(())
}

/// The step between the supervisor and a program: ties this process to the supervisor, then becomes the program.
/// Returns only where that fails.
///
/// A program may ignore every signal and the closed line, and would outlive a killed supervisor. So the kernel kills
/// it with the supervisor. Only the process itself can ask for that, before it executes the program, which keeps the
/// request. The kernel drops the request for an executable with the set-user-ID bit or with capabilities of its own.
pub(crate) fn exec_program(supervisor: i32, path: &Path, arguments: &[OsString]) -> anyhow::Result<Exit> {
    end_with_parent(Pid::from_raw(supervisor))?;
    let error = Command::new(path).args(arguments).exec();
    Err(error).with_context(|| format!("the controller {} cannot be started", path.display()))
}
