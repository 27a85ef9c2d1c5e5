//! The step between the supervisor and a program of the user: it ties the process to the supervisor, then becomes the
//! program.
//!
//! A program may ignore every signal and the closed line, and would outlive a killed supervisor. So the kernel kills it with
//! the supervisor. Only the process itself can ask the kernel for that, before it executes the program, which keeps the
//! request. The kernel drops the request for an executable with the set-user-ID bit or with capabilities of its own.

use std::env;
use std::io;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{self, Command};

use anyhow::{Context, ensure};
use clap::Args;
use masseter_terminal::Exit;
use rustix::process::{Pid, Signal, getppid, set_parent_process_death_signal};

/// The verb's name on the command line.
const VERB: &str = "exec-program";

/// The arguments of the hidden verb.
#[derive(Debug, Clone, Args)]
pub(crate) struct ExecProgramArgs {
    /// Process id of the supervisor
    supervisor: i32,
    /// The program
    path: PathBuf,
}

/// The command that starts the program at `path`, and ends it with the thread that spawns it.
pub(super) fn tied_to_this_process(path: &Path) -> io::Result<Command> {
    let mut command = Command::new(env::current_exe()?);
    command.args([VERB, &process::id().to_string(), "--"]).arg(path);
    Ok(command)
}

/// Becomes the program; returns only where that fails.
pub(crate) fn exec_program(args: &ExecProgramArgs) -> anyhow::Result<Exit> {
    let ExecProgramArgs { supervisor, path } = args;
    set_parent_process_death_signal(Some(Signal::KILL))
        .context("the controller cannot be tied to the rig")?;
    // A supervisor that died before the request gives no signal any more.
    ensure!(getppid() == Pid::from_raw(*supervisor), "the rig died before its controller was started");
    let error = Command::new(path).exec();
    Err(error).with_context(|| format!("the controller {} cannot be started", path.display()))
}
