//! The cases of a campaign on the workers of a HyperQueue server. HyperQueue schedules them; the folder of the
//! campaign holds what has ended. So a worker or the server may die at any time, and the same command goes on.

use std::io::{self, Write};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use anyhow::{Context, anyhow, bail, ensure};
use masseter_campaign::{Campaign, CampaignFolder, CaseResult, StopRules};
use masseter_runtime::clock;
use masseter_terminal::{Exit, Failure, OrFailure, status};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};

use super::play::{Player, controller_of, this_program};
use crate::run::interrupts::Interrupts;
use crate::run::request::ControllerChoice;
use crate::run::runner::Runner;

/// How often cases are submitted that have no result yet.
const ROUNDS: usize = 3;
/// Time between two looks whether the job has ended, or the start is interrupted.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The part in the language of HyperQueue's package.
const SUBMIT: &str = include_str!("submit.py");

/// Where HyperQueue is: each by its own default without it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HyperQueue<'a> {
    /// Folder of the server.
    pub(crate) server_dir: Option<&'a Path>,
    /// Python that has the package hyperqueue.
    pub(crate) python: Option<&'a Path>,
}

/// Submits what has no result, until everything has one or the user interrupts. Returns the results that are there.
pub(crate) fn run(
    campaign: &Campaign,
    folder: &CampaignFolder,
    hyperqueue: HyperQueue<'_>,
    interrupts: &Interrupts,
) -> Result<Vec<CaseResult>, Failure> {
    if campaign.file.stop_after != StopRules::default() {
        return Err(anyhow!("stop_after: HyperQueue runs every case; leave the rule away")).usage();
    }
    // Another number than those of the starts before.
    let start = clock::wall_time().as_nanos() as u64;
    for _ in 0..ROUNDS {
        let (ended, open) = sort_cases(campaign, folder)?;
        if open.is_empty() || interrupts.is_stop_requested() {
            return Ok(ended);
        }
        status!("{} of {} cases to HyperQueue", open.len(), campaign.case_count());
        let job = Job::submit(folder.path(), &open, start, hyperqueue).died()?;
        if let End::Interrupted { number } = job.wait(interrupts).died()? {
            stop(folder, start, number).incomplete()?;
            return Ok(sort_cases(campaign, folder)?.0);
        }
    }
    let (ended, open) = sort_cases(campaign, folder)?;
    if !open.is_empty() {
        let error = anyhow!(
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
fn sort_cases(
    campaign: &Campaign,
    folder: &CampaignFolder,
) -> Result<(Vec<CaseResult>, Vec<usize>), Failure> {
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

/// Keeps the workers from the cases of an interrupted start. The package of HyperQueue cannot cancel a job.
fn stop(folder: &CampaignFolder, start: u64, job: Option<u32>) -> anyhow::Result<()> {
    folder.mark_interrupted(start).context("cannot mark the campaign as interrupted")?;
    let also = job.map_or_else(String::new, |job| format!("; 'hq job cancel {job}' also empties the queue"));
    status!("HyperQueue's workers stop their cases and start no others{also}");
    Ok(())
}

/// A job, and the process that waits for it.
struct Job {
    python: PathBuf,
    waiter: Child,
    submitted: io::Result<()>,
}

/// How a wait ended.
enum End {
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
    fn submit(
        folder: &Path,
        cases: &[usize],
        start: u64,
        hyperqueue: HyperQueue<'_>,
    ) -> anyhow::Result<Self> {
        let folder = folder.canonicalize().context("cannot find the folder of the campaign")?;
        let python = hyperqueue.python.unwrap_or(Path::new("python3")).to_owned();
        let mut waiter = Command::new(&python)
            .args(["-c", SUBMIT])
            .arg(std::env::current_exe().context("cannot find this program")?)
            .arg(folder)
            .arg(start.to_string())
            .arg(hyperqueue.server_dir.unwrap_or(Path::new("")))
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
    fn wait(mut self, interrupts: &Interrupts) -> anyhow::Result<End> {
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
        refuse_unseen_end(&output, &self.python, self.submitted.is_ok())?;
        Ok(End::Ended)
    }
}

/// Refuses the end of a waiter that has not seen its job end.
fn refuse_unseen_end(output: &Output, python: &Path, is_submitted: bool) -> anyhow::Result<()> {
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

/// Runs a case in this process, for a worker, unless its result is there or its start of the campaign is interrupted.
/// Any result is success: the campaign judges.
pub(crate) fn run_case(folder: &Path, number: usize, start: Option<u64>) -> Result<Exit, Failure> {
    die_with_the_parent().died()?;
    let (folder, campaign) = CampaignFolder::open(folder).usage()?;
    let controller = ControllerChoice::Own(controller_of(&campaign).usage()?);
    if this_program().usage()? != campaign.program {
        return Err(anyhow!("another build of masseter began the campaign; begin another one")).usage();
    }
    let count = campaign.case_count();
    if number >= count {
        return Err(anyhow!("the campaign has cases 0 to {}", count.saturating_sub(1))).usage();
    }
    let interrupts = Interrupts::of_verb()?;
    if let Some(start) = start {
        if folder.is_interrupted(start) {
            return Ok(Exit::Interrupted);
        }
        stop_with(start, folder.clone(), interrupts.clone());
    }
    let case = campaign.case(&campaign.points(), number);
    let runner = Runner { controller: &controller, interrupts: &interrupts };
    let result = Player { runner, folder: &folder }.result_of(&case)?;
    Ok(if result.is_some() { Exit::Passed } else { Exit::Interrupted })
}

/// Stops the case once the start is interrupted: a signal does not reach another machine.
fn stop_with(start: u64, folder: CampaignFolder, interrupts: Interrupts) {
    std::thread::spawn(move || {
        while !folder.is_interrupted(start) {
            clock::sleep(LOOK_EVERY);
        }
        interrupts.request_stop();
    });
}

/// A worker that is killed takes its case along: no orphan computes what the next worker computes again.
fn die_with_the_parent() -> anyhow::Result<()> {
    let parent = getppid();
    set_parent_process_death_signal(Some(Signal::KILL)).context("cannot bind the case to its worker")?;
    ensure!(getppid() == parent, "the worker is gone");
    Ok(())
}
