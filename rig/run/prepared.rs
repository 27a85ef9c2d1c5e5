//! A run with its folder: prepared, played into the folder, and reported from there.

use std::fs::File;
use std::path::Path;

use anyhow::Context;
use masseter_analysis::{Analysis, Figures};
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_recording::{Ending, FullSpeed, Manifest, RunFolder};
use masseter_report::Judgement;
use masseter_runtime::transport::{Domain, DomainLock};
use masseter_scenario::input::read_text;
use masseter_scenario::{FileConfig, Scenario};
use masseter_terminal::{Exit, Failure, OrFailure, status};

use super::args::{ClockKind, RunArgs};
use super::resolve::{resolve, resolve_simulated};
use super::room::{self, Reserve};
use super::supervisor;
use crate::arguments::{ControllerChoice, ControllerKind, name_of};
use crate::interrupts::Interrupts;
use crate::robot::Played;
use crate::{BUILD, doctor, robot};

/// Where runs without `--out` go.
pub(super) const RUNS: &str = "runs";

/// A run that can start.
pub(crate) struct PreparedRun {
    plan: RunPlan,
    args: RunArgs,
    /// None under virtual time.
    domain: Option<(Domain, DomainLock)>,
    folder: RunFolder,
    manifest: Manifest,
    reserve: Reserve,
}

/// A run that has ended.
pub(crate) struct PlayedRun {
    args: RunArgs,
    folder: RunFolder,
    manifest: Manifest,
    /// The summary's room on the disk.
    reserved: File,
    /// Whether the manifest was written.
    written: Result<(), Failure>,
}

impl PreparedRun {
    /// Refuses a run that cannot start, and makes the folder of one that can.
    pub(crate) fn new(args: &RunArgs) -> Result<Self, Failure> {
        room::check_memory().usage()?;
        let (plan, args) = resolve(args).usage()?;
        let (controller, motion_s) = (args.controller.name(), plan.trajectory.duration_s());
        let played = Played { scenario: &plan.scenario, controller: controller.as_deref(), motion_s };
        robot::check_bring_up(&played, args.without_bring_up).usage()?;
        room::check_disk(args.out.as_deref().unwrap_or(RUNS.as_ref()), &plan).incomplete()?;
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
        let manifest = manifest_of(&plan, &args);
        // This one remains if the supervisor is killed.
        write_manifest(&folder, &manifest)?;
        let no_room = || format!("no room in {} for the verdict", folder.path().display());
        let reserve = Reserve::take(folder.path()).with_context(no_room).incomplete()?;
        Ok(Self { plan, args, domain, folder, manifest, reserve })
    }

    /// Plays the motion to its end.
    pub(crate) fn play(self, interrupts: &Interrupts) -> Result<PlayedRun, Failure> {
        let Self { plan, args, domain, folder, mut manifest, reserve } = self;
        let ran = match domain {
            None => {
                let build = args.controller.builder().expect("the clock is checked");
                masseter_virtual_time::record(&plan, &folder, build, &mut manifest, interrupts).incomplete()
            }
            Some(domain) => supervisor::run(domain, &plan, &folder, &args, &mut manifest, interrupts),
        };
        if let Err(failure) = &ran {
            manifest.ending = Ending::died("rig", format!("{:#}", failure.error));
        }
        drop(reserve.manifest);
        let written = write_manifest(&folder, &manifest);
        ran?;
        Ok(PlayedRun { args, folder, manifest, reserved: reserve.summary, written })
    }
}

impl PlayedRun {
    /// Judges the run, prints its report and writes it into the folder.
    pub(super) fn report(self) -> Result<Exit, Failure> {
        if self.is_unstarted() {
            let folder = self.folder.path().display();
            status!("masseter: interrupted before the first cycle: nothing is recorded in {folder}");
            return Ok(Exit::Interrupted);
        }
        let Self { args, folder, manifest, reserved, written } = self;
        let exit = masseter_report::report_run(&folder, &manifest, args.format, args.detail(), reserved)?;
        written?;
        let controller = args.controller.name();
        let Manifest { scenario, motion_s, .. } = &manifest;
        let played = Played { scenario, controller: controller.as_deref(), motion_s: *motion_s };
        robot::keep_dry_run(&played, folder.path(), exit == Exit::Passed, args.without_bring_up)
            .incomplete()?;
        Ok(exit)
    }

    /// The same without printing; none for a run that was interrupted before anything was recorded.
    pub(crate) fn judge(self) -> Result<Option<Judgement>, Failure> {
        if self.is_unstarted() {
            return Ok(None);
        }
        let Self { folder, manifest, reserved, written, .. } = self;
        let judgement = masseter_report::judge_run(&folder, &manifest, reserved)?;
        written?;
        Ok(Some(judgement))
    }

    /// Whether it was interrupted before every process was ready: nothing is recorded.
    fn is_unstarted(&self) -> bool {
        let has_processes = self.args.clock != ClockKind::Virtual;
        self.manifest.ending == Ending::Interrupted && has_processes && self.manifest.scheduling.is_empty()
    }
}

/// Plays a run under virtual time without a folder, and judges it from its messages.
pub(crate) fn judge_unrecorded(args: &RunArgs, interrupts: &Interrupts) -> Result<Judgement, Failure> {
    let (plan, args) = resolve(args).usage()?;
    let build =
        args.controller.builder().context("virtual time runs controllers of the rig alone").usage()?;
    let (manifest, figures) = unrecorded(&plan, &args, build, interrupts)?;
    Ok(Judgement::new(&manifest, &figures))
}

/// Plays a scenario under virtual time by a controller of the rig; the figures that its verdict needs, without a folder.
pub(crate) fn figures_unrecorded(
    scenario: &Scenario,
    controller: ControllerKind,
    interrupts: &Interrupts,
) -> Result<(Manifest, Figures), Failure> {
    figures_of(scenario, controller, controller.builder(), interrupts)
}

/// The same by another controller.
#[cfg(test)]
pub(crate) fn figures_by(
    scenario: &Scenario,
    build: BuildController,
    interrupts: &Interrupts,
) -> Result<(Manifest, Figures), Failure> {
    figures_of(scenario, ControllerKind::default(), build, interrupts)
}

fn figures_of(
    scenario: &Scenario,
    controller: ControllerKind,
    build: BuildController,
    interrupts: &Interrupts,
) -> Result<(Manifest, Figures), Failure> {
    let plan = resolve_simulated(scenario, None, build).usage()?;
    let controller = ControllerChoice::Own(controller);
    let args = RunArgs { clock: ClockKind::Virtual, controller, ..RunArgs::default() };
    unrecorded(&plan, &args, build, interrupts)
}

fn unrecorded(
    plan: &RunPlan,
    args: &RunArgs,
    build: BuildController,
    interrupts: &Interrupts,
) -> Result<(Manifest, Figures), Failure> {
    let mut manifest = manifest_of(plan, args);
    let start = Analysis::without_report;
    let figures = masseter_virtual_time::analyse(plan, build, start, &mut manifest, interrupts).died()?;
    Ok((manifest, figures))
}

/// What is known before the start.
fn manifest_of(plan: &RunPlan, args: &RunArgs) -> Manifest {
    let (motion_s, clock) = (plan.trajectory.duration_s(), name_of(&args.clock));
    let machine = masseter_machine::describe();
    let mut manifest = Manifest::new(BUILD, plan.scenario.clone(), motion_s, &clock, machine);
    manifest.motion_end_s = Some(plan.trajectory.motion_time_s(motion_s));
    manifest.controller = args.controller.name();
    manifest.full_speed = plan.scenario.dry.is_on.then_some(FullSpeed {
        velocity_m_s: plan.demands.velocity_m_s,
        acceleration_m_s2: plan.demands.acceleration_m_s2,
    });
    if args.clock == ClockKind::Rt {
        manifest.mending_command = doctor::mending_command();
    }
    manifest
}

fn write_manifest(folder: &RunFolder, manifest: &Manifest) -> Result<(), Failure> {
    let path = folder.manifest();
    manifest.write(folder).with_context(|| format!("cannot write {}", path.display())).incomplete()
}

/// Copies the scenario and the files that it names into the run folder: the originals may change later.
fn keep_scenario(folder: &RunFolder, scenario: &Scenario) -> anyhow::Result<()> {
    let mut kept = scenario.clone();
    for (name, file) in kept.files_mut() {
        let rows = read_text(file, FileConfig::MOST_BYTES);
        let rows = rows.with_context(|| format!("cannot read {}", file.display()))?;
        keep(folder, &folder.file(&name), &rows)?;
        *file = name.into();
    }
    keep(folder, &folder.scenario(), &kept.to_toml())
}

fn keep(folder: &RunFolder, path: &Path, text: &str) -> anyhow::Result<()> {
    folder.keep(path, text).with_context(|| format!("cannot write {}", path.display()))
}
