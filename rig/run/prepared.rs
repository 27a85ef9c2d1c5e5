//! A run with its folder: prepared, played into the folder, and reported from there.

use masseter_recording::{Ending, FullSpeed};
use masseter_report::Detail;
use masseter_scenario::input::{MOST_KEPT_BYTES, foreign_text, read_bytes, read_text};

use super::request::{ClockKind, ControllerChoice, RunRequest, name_of};
use super::room::{self, Reserve};
use super::{interrupts::Interrupts, resolve::resolve, supervisor};
use crate::prelude::*;
use crate::{BUILD, doctor, robot::Played};

/// Where runs without `--out` go.
const RUNS: &str = "runs";

/// A run that can start.
pub(crate) struct PreparedRun {
    plan: RunPlan,
    request: RunRequest,
    /// None under virtual time.
    domain: Option<(masseter_runtime::transport::Domain, masseter_runtime::transport::DomainLock)>,
}

/// A run that has ended.
pub(crate) struct PlayedRun {
    request: RunRequest,
    folder: RunFolder,
    manifest: Manifest,
    /// The summary's room on the disk.
    reserved: fs::File,
    /// Until the run is reported.
    occupied: Option<fs::File>,
    /// For those who watched.
    report_server: Option<masseter_recorder::live::ReportServer>,
    /// Whether the manifest was written.
    written: Result<(), Failure>,
}

impl PreparedRun {
    /// Refuses a run that cannot start. A signal ends this as it ends any program: nothing is made yet.
    pub(crate) fn new(request: &RunRequest) -> Result<Self, Failure> {
        room::check_memory_limits().usage()?;
        let (plan, request) = resolve(request).usage()?;
        let (controller, motion_s) = (request.controller.name(), plan.trajectory.duration_s());
        let (scenario, is_waived) = (&plan.scenario, request.without_bring_up);
        let played = Played { scenario, controller: controller.as_deref(), motion_s, is_waived };
        played.check_bring_up().usage()?;
        let out = std::path::absolute(request.out.as_deref().unwrap_or(RUNS.as_ref()));
        let out = out.context("the current folder does not exist any more: change to another one").usage()?;
        room::check_disk(&out, &plan).incomplete()?;
        let domain = match request.clock {
            ClockKind::Virtual => None,
            ClockKind::Auto | ClockKind::Rt | ClockKind::Lockstep => {
                room::check_open_files().usage()?;
                // This also removes what killed runs left.
                let domain = supervisor::reserve_domain(request.name.as_deref()).usage()?;
                room::check_shared_memory().usage()?;
                Some(domain)
            }
        };
        Ok(Self { plan, request, domain })
    }

    /// Makes the folder, and plays the motion to its end.
    pub(crate) fn play(self, interrupts: &Interrupts) -> Result<PlayedRun, Failure> {
        let Self { plan, request, domain } = self;
        let folder = match &request.out {
            Some(path) => RunFolder::create(path).usage()?,
            None => RunFolder::create_in(RUNS.as_ref(), &plan.scenario.name).usage()?,
        };
        keep_scenario(&folder, &plan.scenario).incomplete()?;
        let occupied = folder.occupy();
        if !request.quiet {
            status!("{}", plan.announcement());
        }
        let mut manifest = manifest_of(&plan, &request.controller, request.clock);
        // This one remains if the supervisor is killed.
        write_manifest(&folder, &manifest)?;
        let no_room = || format!("no room in {} for the verdict", folder.path().display());
        let reserve = Reserve::allocate_in(folder.path()).with_context(no_room).incomplete()?;
        let ran = match domain {
            None => {
                let build = request.controller.builder().expect("the clock is checked");
                masseter_virtual_time::record(&plan, &folder, build, &mut manifest, interrupts)
                    .incomplete()
                    .map(|()| None)
            }
            Some(domain) => supervisor::run(domain, &plan, &folder, &request, &mut manifest, interrupts),
        };
        if let Err(failure) = &ran {
            manifest.ending = Ending::died("rig", format!("{:#}", failure.error));
        }
        drop(reserve.manifest);
        let written = write_manifest(&folder, &manifest);
        let report_server = ran?;
        let reserved = reserve.summary;
        Ok(PlayedRun { request, folder, manifest, reserved, occupied, report_server, written })
    }
}

impl PlayedRun {
    /// Judges the run, prints its report and writes it into the folder.
    pub(crate) fn report(self) -> Result<Exit, Failure> {
        if self.is_unstarted() {
            let folder = self.folder.path().display();
            status!("masseter: interrupted before the first cycle: nothing is recorded in {folder}");
            return Ok(Exit::Interrupted);
        }
        let Self { request, folder, manifest, reserved, occupied, report_server, written } = self;
        let detail = if request.verbose { Detail::Whole } else { Detail::Brief };
        let shown = Some((request.format, detail));
        let exit = masseter_report::report_run(&folder, &manifest, shown, reserved)?.exit_code;
        drop(occupied);
        if let Some(server) = report_server
            && let Ok(html) = read_text(&folder.file("report.html"), MOST_KEPT_BYTES)
        {
            server.serve(&html);
        }
        written?;
        let Manifest { scenario, controller, motion_s, .. } = &manifest;
        let (controller, is_waived) = (controller.as_deref(), request.without_bring_up);
        let played = Played { scenario, controller, motion_s: *motion_s, is_waived };
        played.keep_dry_run(folder.path(), exit == Exit::Passed).incomplete()?;
        Ok(exit)
    }

    /// The same without printing; none for a run that was interrupted before anything was recorded.
    pub(crate) fn judge_unseen(self) -> Result<Option<masseter_judge::Verdict>, Failure> {
        if self.is_unstarted() {
            return Ok(None);
        }
        let Self { folder, manifest, reserved, written, .. } = self;
        let verdict = masseter_report::report_run(&folder, &manifest, None, reserved)?;
        written?;
        Ok(Some(verdict))
    }

    /// Whether it was interrupted before every process was ready: nothing is recorded.
    fn is_unstarted(&self) -> bool {
        let has_processes = self.request.clock != ClockKind::Virtual;
        self.manifest.ending == Ending::Interrupted && has_processes && self.manifest.scheduling.is_empty()
    }
}

/// Plays a run under virtual time without a folder; the figures that its verdict needs.
pub(super) fn analyse_unrecorded(
    plan: &RunPlan,
    controller: &ControllerChoice,
    build: masseter_controller::process::BuildController,
    interrupts: &Interrupts,
) -> Result<(Manifest, masseter_judge::Figures), Failure> {
    let mut manifest = manifest_of(plan, controller, ClockKind::Virtual);
    let start = masseter_judge::Analysis::without_report;
    let figures = masseter_virtual_time::analyse(plan, build, start, &mut manifest, interrupts).died()?;
    Ok((manifest, figures))
}

/// The facts known before the start.
fn manifest_of(plan: &RunPlan, controller: &ControllerChoice, clock: ClockKind) -> Manifest {
    let (motion_s, machine) = (plan.trajectory.duration_s(), masseter_machine::describe());
    let mut manifest = Manifest::new(BUILD, plan.scenario.clone(), motion_s, &name_of(&clock), machine);
    manifest.controller = controller.name();
    manifest.warnings = plan.warnings();
    manifest.full_speed = plan.scenario.dry.is_on.then_some(FullSpeed {
        velocity_m_s: plan.demands.velocity_m_s,
        acceleration_m_s2: plan.demands.acceleration_m_s2,
    });
    if clock == ClockKind::Rt {
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
        let bytes = read_bytes(file, masseter_scenario::FileConfig::MOST_BYTES);
        let bytes = bytes.with_context(|| format!("cannot read {}", file.display()))?;
        // A C3D file is no text.
        match foreign_text(&bytes) {
            Ok(text) => keep(folder, &folder.file(&name), &text)?,
            Err(_) => keep(folder, &folder.file(&name), &bytes)?,
        }
        *file = name.into();
    }
    keep(folder, &folder.scenario(), &kept.to_toml())
}

fn keep(folder: &RunFolder, path: &Path, content: &(impl AsRef<[u8]> + ?Sized)) -> anyhow::Result<()> {
    folder.keep(path, content).with_context(|| format!("cannot write {}", path.display()))
}
