//! A run of the rig that a bench makes and measures, in a folder of its own that goes with it.

use std::fs::{self, File};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;

use anyhow::{Context, bail};
use masseter_runtime::clock;
use masseter_scenario::Scenario;
use rustix::process::{Pid, Signal, kill_process};
use tempfile::TempDir;

use crate::run::interrupts::Interrupts;

/// The user stopped the bench.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
pub(super) struct Interrupted;

/// A run that has ended and left a summary.
#[derive(Debug)]
pub(super) struct PlayedRun {
    scratch: TempDir,
    pub(super) status: ExitStatus,
}

impl PlayedRun {
    /// Plays the scenario by this clock, and checks this often whether the run has ended.
    pub(super) fn make(
        scenario: &Scenario,
        clock: &str,
        check_every: Duration,
        interrupts: &Interrupts,
    ) -> anyhow::Result<Self> {
        let scratch = tempfile::tempdir().context("cannot create a folder for the runs")?;
        let file = scratch.path().join("scenario.toml");
        fs::write(&file, scenario.to_toml()).context("cannot write the scenario")?;
        let errors = scratch.path().join("errors");
        let mut run = Command::new(std::env::current_exe()?)
            .args(["run", "--clock", clock, "--quiet", "--format", "json", "--out"])
            .args([&scratch.path().join("run"), &file])
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(File::create(&errors).context("cannot create a file for the errors of a run")?)
            // An interrupt from the terminal reaches this process alone; it passes it on to the run.
            .process_group(0)
            .spawn()
            .context("cannot start a run")?;
        let status = wait_for(&mut run, check_every, interrupts)?;
        let played = Self { scratch, status };
        if !played.folder().join("summary.json").exists() {
            bail!("the run left no summary: {}", fs::read_to_string(errors)?.trim());
        }
        Ok(played)
    }

    /// What the run has left.
    pub(super) fn folder(&self) -> PathBuf {
        self.scratch.path().join("run")
    }
}

/// Waits for a run. Each interrupt is passed on to the run; the bench ends after it.
fn wait_for(run: &mut Child, check_every: Duration, interrupts: &Interrupts) -> anyhow::Result<ExitStatus> {
    let mut passed_on = 0;
    loop {
        if let Some(status) = run.try_wait()? {
            return if interrupts.is_stop_requested() { Err(Interrupted.into()) } else { Ok(status) };
        }
        if passed_on < u8::from(interrupts.is_stop_requested()) + u8::from(interrupts.is_abort_requested()) {
            // The run may have ended meanwhile.
            let _ = kill_process(Pid::from_child(run), Signal::TERM);
            passed_on += 1;
        }
        clock::sleep(check_every);
    }
}
