//! The cases of a campaign on the workers of a HyperQueue server. HyperQueue schedules; the folder of the campaign knows what
//! has ended. So a worker or the server may die at any time, and the same command goes on.

mod job;

use anyhow::Context;
use masseter_campaign::{Campaign, CampaignFolder, CaseResult, StopRules};
use masseter_runtime::clock;
use masseter_terminal::{Failure, OrFailure, status};

use super::args::HyperqueueArgs;
use crate::interrupts::Interrupts;
use job::{End, Job};

/// How often cases are submitted that have no result yet.
const ROUNDS: usize = 3;

/// Submits what has no result, until everything has one or the user interrupts. Returns the results that are there.
pub(super) fn run(
    campaign: &Campaign,
    folder: &CampaignFolder,
    args: &HyperqueueArgs,
    interrupts: &Interrupts,
) -> Result<Vec<CaseResult>, Failure> {
    if campaign.file.stop_after != StopRules::default() {
        return Err(anyhow::anyhow!("stop_after: HyperQueue runs every case; leave the rule away")).usage();
    }
    // Another number than those of the starts before.
    let start = clock::wall_time().as_nanos() as u64;
    for _ in 0..ROUNDS {
        let (ended, open) = sort(campaign, folder)?;
        if open.is_empty() || interrupts.is_stop_requested() {
            return Ok(ended);
        }
        status!("{} of {} cases to HyperQueue", open.len(), campaign.case_count());
        let job = Job::submit(folder.path(), &open, start, args).died()?;
        if let End::Interrupted { number } = job.wait(interrupts).died()? {
            stop(folder, start, number).incomplete()?;
            return Ok(sort(campaign, folder)?.0);
        }
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

/// Keeps the workers from the cases of an interrupted start. The package of HyperQueue cannot cancel a job.
fn stop(folder: &CampaignFolder, start: u64, job: Option<u32>) -> anyhow::Result<()> {
    folder.interruption(start).mark().context("cannot mark the campaign as interrupted")?;
    let also = job.map_or_else(String::new, |job| format!("; 'hq job cancel {job}' also empties the queue"));
    status!("HyperQueue's workers stop their cases and start no others{also}");
    Ok(())
}
