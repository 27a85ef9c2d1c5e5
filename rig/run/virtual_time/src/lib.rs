//! The [`Rig`] that steps, and the run under virtual time: a loop over a rig in one thread, as fast as it goes. The
//! messages of a run go to a [`Sink`]. No process, no transport and no clock of the machine is involved.
//!
//! This is a crate of its own because the compiler makes the code of a cycle where the ports are known. That is here.

mod branches;
mod log;
mod rig;
mod run;
mod snapshot;
mod stepper;

use anyhow::Context;
use masseter_controller::process::BuildController;
use masseter_judge::{Analysis, Figures};
use masseter_plan::RunPlan;
use masseter_recording::{Backlog, Ending, Manifest, Pace, Recorder, RunFolder, Scene};

use run::built;

pub use branches::{BranchError, Branches, Mark};
pub use log::{Log, LoggedPorts, Sink};
pub use rig::{Rig, RigError};
pub use run::{Requests, RestoreError, Run, RunSnapshot, Uninterrupted, Without};
pub use snapshot::{OtherScenario, Snapshot, SnapshotError, SnapshotProblem};

/// Makes the analysis of a run: with everything that a report shows, or with what a verdict needs alone.
pub type StartAnalysis = fn(&masseter_scenario::Scenario, &masseter_runtime::named::Declared) -> Analysis;

/// Plays a run and records it. The run ends as one with processes does, also when the user stops it. Enters the
/// ending and what the controller declares into the manifest.
pub fn record(
    plan: &RunPlan,
    folder: &RunFolder,
    build: BuildController,
    manifest: &mut Manifest,
    interrupts: &dyn Requests,
) -> anyhow::Result<()> {
    let backlog = |declared: &_| {
        let mut recorder = Recorder::of_run(folder, Scene::new(&plan.mechanism, &plan.scenario.jaw))?;
        recorder.declare(declared)?;
        Ok(Backlog::start(recorder, Pace::Virtual))
    };
    let mut run = Run::with_sink(plan, built(plan, build), backlog)?;
    manifest.declared.clone_from(run.declared());
    manifest.ending = run.play(interrupts);
    if let Some(loss) = run.into_sink().finish().loss() {
        masseter_terminal::status!("masseter: {loss}; the run ends here");
        manifest.ending = match &manifest.ending {
            died @ Ending::Died { .. } => died.clone(),
            _ => Ending::RecordingFailed,
        };
    }
    Ok(())
}

/// Plays a run without recording it, and returns its figures. Enters the ending and what the controller declares into
/// the manifest.
pub fn analyse(
    plan: &RunPlan,
    build: BuildController,
    start: StartAnalysis,
    manifest: &mut Manifest,
    interrupts: &dyn Requests,
) -> anyhow::Result<Figures> {
    let stream = |declared: &_| Ok(log::Stream::new(start(&plan.scenario, declared)));
    let mut run = Run::with_sink(plan, built(plan, build), stream)?;
    manifest.declared.clone_from(run.declared());
    manifest.ending = run.play(interrupts);
    run.into_sink().figures().context("a message on topic 'frame' holds no CAN frame")
}
