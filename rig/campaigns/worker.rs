//! One case of a campaign in a process of its own, for engines that start processes.

use std::time::Duration;

use anyhow::{Context, ensure};
use masseter_campaign::{CampaignFolder, Interruption};
use masseter_runtime::clock;
use masseter_terminal::{Exit, Failure, OrFailure};
use rustix::process::{Signal, getppid, set_parent_process_death_signal};

use super::args::CampaignCaseArgs;
use super::player::Player;
use super::{controller_of, program};
use crate::interrupts::Interrupts;

/// Time between two looks whether the start is interrupted.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Runs a case unless its result is there, or its start of the campaign is interrupted. Any result is success: the
/// campaign judges.
pub(crate) fn run_case(args: &CampaignCaseArgs) -> Result<Exit, Failure> {
    die_with_the_parent().died()?;
    let (folder, campaign) = CampaignFolder::open(&args.folder).usage()?;
    let controller = controller_of(&campaign).usage()?;
    if program().usage()? != campaign.program {
        return Err(anyhow::anyhow!("another build of masseter began the campaign; begin another one"))
            .usage();
    }
    let count = campaign.case_count();
    if args.number >= count {
        return Err(anyhow::anyhow!("the campaign has cases 0 to {}", count.saturating_sub(1))).usage();
    }
    let interrupts = Interrupts::listen().context("cannot listen for signals").died()?;
    if let Some(start) = args.start {
        let interruption = folder.interruption(start);
        if interruption.is_marked() {
            return Ok(Exit::Interrupted);
        }
        stop_at(interruption, interrupts.clone());
    }
    let case = campaign.case(&campaign.points(), args.number);
    let result = Player { controller, interrupts: &interrupts }.settle(&folder, &case)?;
    Ok(if result.is_some() { Exit::Passed } else { Exit::Interrupted })
}

/// Stops the case once the start is interrupted: a signal does not reach another machine.
fn stop_at(interruption: Interruption, interrupts: Interrupts) {
    std::thread::spawn(move || {
        while !interruption.is_marked() {
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
