//! The controller from the side of the supervisor: the rig's own process, a [program](Program) of the user, or none.

use std::{ffi::OsString, io, os::fd::OwnedFd};

use masseter_runtime::lifecycle::{End, Order};
use masseter_runtime::{clock, lifecycle::attach::Invitation, transport::Domain};
use masseter_terminal::Exit;

use super::child::{CONTROLLER, Process, Ready, Reports, describe};
use super::program::Program;
use super::request::{ControllerChoice, name_of};

/// The controller of a run.
pub(super) enum Controller {
    Own(Box<Process>),
    Program(Box<Program>),
    /// The run lasts as long as the motion, from its start.
    None {
        motion_ns: u64,
        ends_ns: u64,
    },
}

impl Controller {
    /// Starts the chosen controller, or listens for one.
    pub(super) fn start_process(
        choice: &ControllerChoice,
        domain: &Domain,
        invitation: Invitation,
        arguments: Vec<OsString>,
        motion_s: f64,
    ) -> anyhow::Result<Self> {
        Ok(match choice {
            ControllerChoice::Own(kind) => {
                let kind = ["--kind".into(), name_of(kind).into()];
                Self::Own(Box::new(Process::spawn(CONTROLLER, &[arguments, kind.to_vec()].concat())?))
            }
            ControllerChoice::External => Self::Program(Box::new(Program::external(domain, invitation)?)),
            ControllerChoice::None => Self::None { motion_ns: (motion_s * 1e9) as u64, ends_ns: u64::MAX },
            ControllerChoice::Executable(path, arguments) => {
                Self::Program(Box::new(Program::executable(domain, invitation, path, arguments)?))
            }
        })
    }

    /// Its process id; 0 where it is not known: before it is admitted, or from another container.
    pub(super) fn id(&self) -> u32 {
        match self {
            Self::Own(process) => process.id(),
            Self::Program(program) => program.id(),
            Self::None { .. } => 0,
        }
    }

    /// Whether the rig has a controller to wait for.
    pub(super) fn is_awaited(&self) -> bool {
        !matches!(self, Self::None { .. })
    }

    /// Waits until it reports that it is ready; none if `is_cancelled` becomes true first. The wait for a program
    /// fails once another process has died.
    pub(super) fn wait_ready(
        &mut self,
        is_cancelled: impl Fn() -> bool,
        has_died: impl FnMut() -> Option<String>,
    ) -> anyhow::Result<Option<Ready>> {
        match self {
            Self::Own(process) => process.wait_ready(is_cancelled),
            Self::Program(program) => program.wait_ready(is_cancelled, has_died),
            Self::None { .. } => Ok(None),
        }
    }

    /// Sends it an order. One without a line has ended.
    pub(super) fn order(&mut self, order: &Order) -> io::Result<()> {
        match (self, order) {
            (Self::Own(process), order) => process.order(order)?,
            (Self::Program(program), order) => program.order(order),
            (Self::None { motion_ns, ends_ns }, Order::Start(start)) => {
                *ends_ns = start.epoch_ns + *motion_ns;
            }
            (Self::None { .. }, _) => {}
        }
        Ok(())
    }

    /// Its reports; none before a program is admitted.
    pub(super) fn reports(&mut self) -> Option<&mut Reports> {
        match self {
            Self::Own(process) => Some(&mut process.reports),
            Self::Program(program) => program.reports(),
            Self::None { .. } => None,
        }
    }

    /// Its process file; `None` if the rig has not started it.
    pub(super) fn handle(&self) -> io::Result<Option<OwnedFd>> {
        match self {
            Self::Own(process) => process.handle().map(Some),
            Self::Program(program) => program.handle(),
            Self::None { .. } => Ok(None),
        }
    }

    /// Kills it (SIGKILL), as a fault does; whether it could.
    pub(super) fn kill(&mut self) -> bool {
        match self {
            Self::Own(process) => {
                process.kill();
                true
            }
            Self::Program(program) => program.kill(),
            Self::None { .. } => false,
        }
    }

    /// How it ended its work; none while it works.
    pub(super) fn end(&mut self) -> io::Result<Option<End>> {
        match self {
            Self::Program(program) => program.end(),
            Self::None { ends_ns, .. } => Ok((clock::now_ns() >= *ends_ns).then_some(End::Finished)),
            Self::Own(process) => Ok(process.exit_status()?.map(|status| match status.code() {
                Some(code) if code == Exit::Passed as i32 => End::Finished,
                Some(code) if code == Exit::SafeStop as i32 => End::SafeStop,
                _ => End::Failed { reason: describe(status) },
            })),
        }
    }

    /// Whether it has left without a report, though its exit status is not known yet.
    pub(super) fn has_left(&self) -> bool {
        matches!(self, Self::Program(program) if program.has_left())
    }

    /// Asks it to end.
    pub(super) fn terminate(&mut self) {
        match self {
            Self::Own(process) => process.terminate(),
            Self::Program(program) => program.order(&Order::Stop),
            Self::None { ends_ns, .. } => *ends_ns = 0,
        }
    }

    /// Goes on without it; returns what became of it, in words.
    pub(super) fn give_up(&mut self) -> &'static str {
        match self {
            Self::Own(process) => process.give_up(),
            Self::Program(program) => program.give_up(),
            Self::None { .. } => "was not started by the rig",
        }
    }
}
