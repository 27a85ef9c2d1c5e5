//! `masseter run`: from arguments to a verdict.
//!
//! [`plan`] refuses whatever cannot run before anything starts; then [`supervisor`] runs the three
//! processes, or [`virtual_time`] their cores; then the recording is analysed and the run judged.

pub mod args;
pub mod child;
pub mod dma_latency;
pub mod ending;
pub mod folder;
pub mod interrupts;
pub mod manifest;
pub mod plan;
pub mod supervisor;
pub mod usage;
pub mod virtual_time;

use std::fs;
use std::path::Path;

use anyhow::Context;
use masseter_shared::config::{MotionConfig, Scenario};

use crate::analysis;
use crate::exit::{Exit, Failure, OrFailure};
use crate::report;
use args::{ClockKind, RunArgs};
use ending::Ending;
use folder::RunFolder;
use manifest::Manifest;
use plan::Plan;
use supervisor::Ended;

/// Plays the motion, judges the run and leaves its folder.
pub fn run(args: &RunArgs) -> Result<Exit, Failure> {
    let plan = Plan::resolve(args).usage()?;
    let claimed = match args.clock {
        ClockKind::Virtual => None,
        ClockKind::Rt => Some(supervisor::claim(args.name.as_deref()).usage()?),
    };
    let folder = match &args.out {
        Some(path) => RunFolder::create(path).usage()?,
        None => RunFolder::create_in("runs".as_ref(), &plan.scenario.name).usage()?,
    };
    keep_scenario(&folder, &plan.scenario).incomplete()?;
    if !args.quiet {
        tell!("{}", plan.announcement());
    }

    let mut manifest = Manifest::new(&plan, args.clock);
    let unwritten = || format!("cannot write {}", folder.manifest().display());
    let keep = |manifest: &Manifest| manifest.write(&folder).with_context(unwritten).incomplete();
    // For a recording that nobody lives to judge.
    keep(&manifest)?;
    let ended = match claimed {
        None => virtual_time::run(&plan, &folder).map(Ended::from).incomplete(),
        Some(claimed) => supervisor::run(claimed, &plan, &folder, args),
    };
    let ended = ended.or_else(|failure| {
        manifest.ending = Ending::died("rig", format!("{:#}", failure.error));
        keep(&manifest)?;
        Err(failure)
    })?;
    manifest.scheduling = ended.scheduling;
    manifest.cpu_dma_latency = ended.cpu_dma_latency;
    manifest.usage = ended.usage;
    manifest.ending = ended.ending;
    keep(&manifest)?;
    // Before the processes were ready, and anything was recorded.
    let is_in_processes = args.clock == ClockKind::Rt;
    if manifest.ending == Ending::Interrupted && is_in_processes && manifest.scheduling.is_empty() {
        return Ok(Exit::Interrupted);
    }
    let figures = analysis::analyse(&folder, &plan.scenario)
        .context("the run's recording cannot be analysed")
        .incomplete()?;
    report::write(&folder, &manifest, &figures, args.format)
}

/// Keeps the scenario and the recording it plays together: another one may lie where that was by the time it is run
/// again.
fn keep_scenario(folder: &RunFolder, scenario: &Scenario) -> anyhow::Result<()> {
    let mut kept = scenario.clone();
    if let MotionConfig::File(file) = &mut kept.motion {
        let rows =
            fs::read_to_string(&file.path).with_context(|| format!("cannot read {}", file.path.display()))?;
        keep(folder, &folder.motion(), &rows)?;
        file.path = folder::MOTION.into();
    }
    keep(folder, &folder.scenario(), &kept.to_toml())
}

fn keep(folder: &RunFolder, path: &Path, text: &str) -> anyhow::Result<()> {
    folder.keep(path, text).with_context(|| format!("cannot write {}", path.display()))
}
