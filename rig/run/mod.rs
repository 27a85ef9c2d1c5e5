//! `masseter run`: from arguments to a verdict.
//!
//! [`masseter_plan`] refuses whatever cannot run before anything starts; then [`supervisor`] runs the three
//! processes, or [`virtual_time`] their cores; then the recording is analysed and the run judged.

pub mod args;
pub mod child;
pub mod ending;
pub mod supervisor;
pub mod usage;
pub mod virtual_time;

use std::fs;
use std::path::Path;

use anyhow::{Context, bail};
use masseter_plan::Plan;
use masseter_plant::core as plant;
use masseter_recording::{Ending, MOTION, Manifest, RunFolder};
use masseter_shared::config::{MotionConfig, Scenario};

use crate::{live, machine};
use args::{ClockKind, RunArgs};
use masseter_terminal::{Exit, Failure, OrFailure, status};
use supervisor::Ended;

/// Plays the motion, judges the run and leaves its folder.
pub fn run(args: &RunArgs) -> Result<Exit, Failure> {
    let plan = resolve(args).usage()?;
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
        status!("{}", plan.announcement());
    }

    let motion_s = plan.trajectory.duration_s();
    let mut manifest = Manifest::new(plan.scenario.clone(), motion_s, args.clock.name(), machine::describe());
    let unwritten = || format!("cannot write {}", folder.manifest().display());
    let keep = |manifest: &Manifest| manifest.write(&folder).with_context(unwritten).incomplete();
    // For a recording that nobody lives to judge.
    keep(&manifest)?;
    let ended = match claimed {
        None => virtual_time::run(&plan, &folder, args.controller.into()).map(Ended::from).incomplete(),
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
    masseter_report::report_run(&folder, &manifest, args.format)
}

/// Plans the run that the arguments ask for, and refuses what this machine does not have.
fn resolve(args: &RunArgs) -> anyhow::Result<Plan> {
    let scenario = masseter_plan::scenario(args.scenario.as_deref(), &args.overrides())?;
    check_clock(args, &scenario)?;
    args.live.map_or(Ok(()), live::check)?;
    let plan = Plan::of(scenario)?;
    plant::check_interfaces(&plan.scenario).context("the plant cannot be built")?;
    Ok(plan)
}

/// Virtual time leaves no room for what only real time has.
fn check_clock(args: &RunArgs, scenario: &Scenario) -> anyhow::Result<()> {
    if args.clock == ClockKind::Rt {
        return Ok(());
    }
    if !scenario.can.is_virtual() {
        bail!("virtual time has no real wires: use --can virtual, or --clock rt");
    }
    if args.require_rt || args.name.is_some() {
        bail!(
            "virtual time needs no real time and has no other rig beside it: leave out --require-rt and --name"
        );
    }
    if args.live.is_some() {
        bail!("virtual time is over before it can be watched: leave out --live, or use --clock rt");
    }
    Ok(())
}

/// Keeps the scenario and the recording it plays together: another one may lie where that was by the time it is run
/// again.
fn keep_scenario(folder: &RunFolder, scenario: &Scenario) -> anyhow::Result<()> {
    let mut kept = scenario.clone();
    if let MotionConfig::File(file) = &mut kept.motion {
        let rows =
            fs::read_to_string(&file.path).with_context(|| format!("cannot read {}", file.path.display()))?;
        keep(folder, &folder.motion(), &rows)?;
        file.path = MOTION.into();
    }
    keep(folder, &folder.scenario(), &kept.to_toml())
}

fn keep(folder: &RunFolder, path: &Path, text: &str) -> anyhow::Result<()> {
    folder.keep(path, text).with_context(|| format!("cannot write {}", path.display()))
}
