//! The cases of a campaign on the workers of a HyperQueue server. HyperQueue schedules; the folder of the campaign knows what
//! has ended. So a worker or the server may die at any time, and the same command goes on.

use std::io::Write;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, bail, ensure};
use masseter_campaign::{Campaign, CampaignFolder, CaseResult, StopRules};
use masseter_shared::clock;
use masseter_terminal::{Failure, OrFailure, status};

use super::args::HyperqueueArgs;
use crate::machine::interrupts::Interrupts;

/// How often cases are submitted that have no result yet.
const ROUNDS: usize = 3;
/// Time between two looks whether the job has ended.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The part in the language of HyperQueue's package.
const SUBMIT: &str = include_str!("hyperqueue.py");

/// Submits what has no result, until everything has one. Returns the results of all cases.
pub(super) fn run(
    campaign: &Campaign,
    folder: &CampaignFolder,
    args: &HyperqueueArgs,
    interrupts: &Interrupts,
) -> Result<Vec<CaseResult>, Failure> {
    if campaign.file.stop_after != StopRules::default() {
        return Err(anyhow::anyhow!("stop_after: HyperQueue runs every case; leave the rule away")).usage();
    }
    for _ in 0..ROUNDS {
        let (ended, open) = sort(campaign, folder)?;
        if open.is_empty() || interrupts.is_stop_requested() {
            return Ok(ended);
        }
        status!("{} of {} cases to HyperQueue", open.len(), campaign.case_count());
        submit(folder.path(), &open, args, interrupts).died()?;
    }
    let (ended, open) = sort(campaign, folder)?;
    if !open.is_empty() {
        let error = anyhow::anyhow!(
            "{} cases ended {ROUNDS} times without a result, the first of them {}: run it by hand: masseter campaign-case {} {}",
            open.len(),
            open[0],
            folder.path().display(),
            open[0]
        );
        return Err(error).died();
    }
    Ok(ended)
}

/// The results that are there, and the numbers of the cases without one.
fn sort(campaign: &Campaign, folder: &CampaignFolder) -> Result<(Vec<CaseResult>, Vec<usize>), Failure> {
    let points = campaign.points();
    let (mut ended, mut open) = (Vec::new(), Vec::new());
    for number in 0..campaign.case_count() {
        match folder.result_of(&campaign.case(&points, number)).incomplete()? {
            Some(result) => ended.push(CaseResult { number, ..result }),
            None => open.push(number),
        }
    }
    Ok((ended, open))
}

/// Waits until the job has ended, or the user interrupts. What is submitted goes on at its workers.
fn submit(
    folder: &Path,
    open: &[usize],
    args: &HyperqueueArgs,
    interrupts: &Interrupts,
) -> anyhow::Result<()> {
    let folder = folder.canonicalize().context("cannot find the folder of the campaign")?;
    let python = args.python.as_deref().unwrap_or(Path::new("python3"));
    let mut child = Command::new(python)
        .args(["-c", SUBMIT])
        .arg(std::env::current_exe().context("cannot find this program")?)
        .arg(folder)
        .arg(args.server_dir.as_deref().unwrap_or(Path::new("")))
        .stdin(Stdio::piped())
        .stderr(Stdio::piped())
        // An interrupt from the terminal reaches this process alone.
        .process_group(0)
        .spawn()
        .with_context(|| {
            format!("cannot start {}: install it, or name another --python", python.display())
        })?;
    let numbers: Vec<_> = open.iter().map(ToString::to_string).collect();
    let written = child.stdin.take().context("no standard input")?.write_all(numbers.join(" ").as_bytes());
    while child.try_wait().context("cannot wait for HyperQueue")?.is_none() {
        if interrupts.is_stop_requested() {
            let _ = child.kill();
            let _ = child.wait();
            return Ok(());
        }
        clock::sleep(LOOK_EVERY);
    }
    let output = child.wait_with_output().context("cannot wait for HyperQueue")?;
    let said = String::from_utf8_lossy(&output.stderr);
    if said.contains("No module named 'hyperqueue'") {
        bail!(
            "{} has no package hyperqueue: pip install hyperqueue, in the version of the server",
            python.display()
        );
    }
    let last = said.trim().lines().next_back().unwrap_or_default();
    ensure!(
        output.status.success() && written.is_ok(),
        "HyperQueue does not answer: {last}; start its server and workers, and the same command goes on where this one \
         was"
    );
    Ok(())
}
