//! `masseter run`: from arguments to a verdict.
//!
//! [`masseter_plan`] refuses a scenario that cannot run before anything starts. Then [`supervisor`] runs the three
//! processes, or [`virtual_time`] steps their cores. Analysis and report judge the recording.

pub(crate) mod args;
mod child;
mod clock;
mod controller;
mod ending;
pub(crate) mod exec_program;
mod program;
mod reports;
mod room;
mod supervisor;
mod usage;
mod virtual_time;

use std::path::Path;

use anyhow::Context;
use masseter_plan::RunPlan;
use masseter_plant::core as plant;
use masseter_recording::{Ending, MOTION, Manifest, RunFolder};
use masseter_shared::config::{FileConfig, MotionConfig, Scenario};
use masseter_shared::input::read_text;
use masseter_shared::named::{NameError, NamedValues};
use masseter_terminal::{Exit, Failure, OrFailure, status};

use crate::arguments::{check_cores, name_of};
use crate::{doctor, foxglove, machine};
use args::{ClockKind, RunArgs};
use room::Reserve;

/// Where runs without `--out` go.
const RUNS: &str = "runs";

/// Plays the motion, judges the run, and writes its folder.
pub(crate) fn run(args: &RunArgs) -> Result<Exit, Failure> {
    room::check_memory().usage()?;
    let (plan, args) = &resolve(args).usage()?;
    room::check_disk(args.out.as_deref().unwrap_or(RUNS.as_ref()), plan).incomplete()?;
    let domain = match args.clock {
        ClockKind::Virtual => None,
        ClockKind::Auto | ClockKind::Rt | ClockKind::Lockstep => {
            // This also removes what killed runs left.
            let domain = supervisor::reserve_domain(args.name.as_deref()).usage()?;
            room::check_shared_memory().usage()?;
            Some(domain)
        }
    };
    let folder = match &args.out {
        Some(path) => RunFolder::create(path).usage()?,
        None => RunFolder::create_in(RUNS.as_ref(), &plan.scenario.name).usage()?,
    };
    keep_scenario(&folder, &plan.scenario).incomplete()?;
    if !args.quiet {
        status!("{}", plan.announcement());
    }

    let motion_s = plan.trajectory.duration_s();
    let clock = name_of(&args.clock);
    let mut manifest = Manifest::new(plan.scenario.clone(), motion_s, &clock, machine::describe());
    manifest.controller = args.controller.name();
    if args.clock == ClockKind::Rt {
        manifest.mending_command = doctor::mending_command();
    }
    // This one remains if the supervisor is killed.
    write_manifest(&folder, &manifest)?;
    let no_room = || format!("no room in {} for the verdict", folder.path().display());
    let reserve = Reserve::take(folder.path()).with_context(no_room).incomplete()?;
    let ran = match domain {
        None => {
            let build = args.controller.builder().expect("the clock is checked");
            virtual_time::run(plan, &folder, build, &mut manifest).incomplete()
        }
        Some(domain) => supervisor::run(domain, plan, &folder, args, &mut manifest),
    };
    if let Err(failure) = &ran {
        manifest.ending = Ending::died("rig", format!("{:#}", failure.error));
    }
    drop(reserve.manifest);
    let written = write_manifest(&folder, &manifest);
    ran?;
    // Interrupted before every process was ready: nothing is recorded.
    let is_unstarted = args.clock != ClockKind::Virtual && manifest.scheduling.is_empty();
    if manifest.ending == Ending::Interrupted && is_unstarted {
        return Ok(Exit::Interrupted);
    }
    let exit = masseter_report::report_run(&folder, &manifest, args.format, args.detail(), reserve.summary)?;
    written?;
    Ok(exit)
}

fn write_manifest(folder: &RunFolder, manifest: &Manifest) -> Result<(), Failure> {
    let path = folder.manifest();
    manifest.write(folder).with_context(|| format!("cannot write {}", path.display())).incomplete()
}

/// Plans the run and chooses its clock; refuses interfaces and addresses that this machine does not have.
fn resolve(args: &RunArgs) -> anyhow::Result<(RunPlan, RunArgs)> {
    let scenario = masseter_plan::scenario_with_overrides(args.scenario.as_deref(), &args.overrides())?;
    args.cores.map_or(Ok(()), |cores| check_cores(&cores))?;
    let args = clock::choose(args, &scenario);
    clock::check(&args, &scenario)?;
    args.live.map_or(Ok(()), foxglove::check)?;
    let plan = RunPlan::of_file(scenario, args.scenario.as_deref())?;
    plant::check_interfaces(&plan.scenario)?;
    if let Some(build) = args.controller.builder() {
        let controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
        NamedValues::new(controller.declared(), &plan.scenario.parameters)
            .map_err(|error| with_question(&error))?;
    }
    Ok((plan, args))
}

/// A refusal of `[parameters]`: a name that `--set` was given may be meant as a key of the scenario.
fn with_question(error: &NameError) -> anyhow::Error {
    let question = match error {
        NameError::Unknown { name, .. } => Scenario::question_for(name),
        _ => None,
    };
    let question =
        question.map_or_else(String::new, |question| format!("; of the keys of a scenario, {question}"));
    anyhow::anyhow!("[parameters]: {error}{question}")
}

/// Copies the scenario, and the motion file that it plays, into the run folder: the original may change later.
fn keep_scenario(folder: &RunFolder, scenario: &Scenario) -> anyhow::Result<()> {
    let mut kept = scenario.clone();
    if let MotionConfig::File(file) = &mut kept.motion {
        let rows = read_text(&file.path, FileConfig::MOST_BYTES);
        let rows = rows.with_context(|| format!("cannot read {}", file.path.display()))?;
        keep(folder, &folder.motion(), &rows)?;
        file.path = MOTION.into();
    }
    keep(folder, &folder.scenario(), &kept.to_toml())
}

fn keep(folder: &RunFolder, path: &Path, text: &str) -> anyhow::Result<()> {
    folder.keep(path, text).with_context(|| format!("cannot write {}", path.display()))
}
