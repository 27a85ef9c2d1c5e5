//! A job of HyperQueue, through its Python package.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use masseter_runtime::clock;

use crate::campaigns::args::HyperqueueArgs;
use crate::interrupts::Interrupts;

/// Time between two looks whether the job has ended.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The part in the language of HyperQueue's package.
const SUBMIT: &str = include_str!("submit.py");

/// A job, and the process that waits for it.
pub(super) struct Job {
    python: PathBuf,
    waiter: Child,
    submitted: io::Result<()>,
}

/// How a wait ended.
pub(super) enum End {
    /// Every task of the job has ended.
    Ended,
    /// The user interrupts.
    Interrupted {
        /// The job's number, if HyperQueue has the job.
        number: Option<u32>,
    },
}

impl Job {
    /// Submits these cases of the campaign in a folder, as those of the start with that number.
    ///
    /// # Errors
    /// When Python does not start.
    pub(super) fn submit(
        folder: &Path,
        cases: &[usize],
        start: u64,
        args: &HyperqueueArgs,
    ) -> anyhow::Result<Self> {
        let folder = folder.canonicalize().context("cannot find the folder of the campaign")?;
        let python = args.python.clone().unwrap_or_else(|| "python3".into());
        let mut waiter = Command::new(&python)
            .args(["-c", SUBMIT])
            .arg(std::env::current_exe().context("cannot find this program")?)
            .arg(folder)
            .arg(start.to_string())
            .arg(args.server_dir.as_deref().unwrap_or(Path::new("")))
            // A progress bar that nobody reads would fill the pipe, and the waiter would stop.
            .env("TQDM_DISABLE", "1")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            // An interrupt from the terminal reaches this process alone.
            .process_group(0)
            .spawn()
            .with_context(|| {
                format!("cannot start {}: install it, or name another --python", python.display())
            })?;
        let numbers: Vec<_> = cases.iter().map(ToString::to_string).collect();
        let submitted =
            waiter.stdin.take().context("no standard input")?.write_all(numbers.join(" ").as_bytes());
        Ok(Self { python, waiter, submitted })
    }

    /// Waits until the job has ended, or the user interrupts. An interrupt leaves the job to HyperQueue.
    ///
    /// # Errors
    /// When HyperQueue does not answer.
    pub(super) fn wait(mut self, interrupts: &Interrupts) -> anyhow::Result<End> {
        while self.waiter.try_wait().context("cannot wait for HyperQueue")?.is_none() {
            if interrupts.is_stop_requested() {
                let _ = self.waiter.kill();
                let said = self.waiter.wait_with_output().context("cannot wait for HyperQueue")?.stdout;
                let number = String::from_utf8_lossy(&said).trim().parse().ok();
                return Ok(End::Interrupted { number });
            }
            clock::sleep(LOOK_EVERY);
        }
        let output = self.waiter.wait_with_output().context("cannot wait for HyperQueue")?;
        check(&output, &self.python, self.submitted.is_ok())?;
        Ok(End::Ended)
    }
}

/// Refuses the end of a waiter that has not seen its job end.
fn check(output: &Output, python: &Path, is_submitted: bool) -> anyhow::Result<()> {
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("No module named 'hyperqueue'") {
        bail!(
            "{} has no package hyperqueue: pip install hyperqueue, in the version of the server",
            python.display()
        );
    }
    let last = said.trim().lines().next_back().unwrap_or_default();
    ensure!(
        output.status.success() && is_submitted,
        "HyperQueue does not answer: {last}; start its server and workers, and the same command goes on where this one \
         was"
    );
    Ok(())
}
