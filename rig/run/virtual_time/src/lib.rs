//! The [`Rig`] that steps, and the run under virtual time: a loop over a rig in one thread, as fast as it goes. The
//! messages of a run go to a [`Sink`]. No process, no transport and no clock of the machine is involved.
//!
//! This is a crate of its own because the compiler makes the code of a cycle where the ports are known. That is here,
//! fully optimised.

mod log;
mod rig;

use anyhow::Context;
use masseter_analysis::{Analysis, Figures};
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_recording::{Backlog, Ending, Manifest, Pace, Recorder, RunFolder, Scene};
use masseter_runtime::control::{Controller, Duties, Operator, Outcome, set_parameters};
use masseter_runtime::lifecycle::Party;
use masseter_runtime::lockstep::EPOCH_NS;
use masseter_runtime::named::{Declared, NamedValues};
use masseter_scenario::Scenario;
use masseter_terminal::status;

use log::Stream;
use rig::Stepper;

pub use log::{Log, LoggedPorts, Sink};
pub use rig::{Rig, RigError, Snapshot};

/// What the user asks of a run.
pub trait Requests {
    /// Whether an orderly stop is requested.
    fn is_stop_requested(&self) -> bool;

    /// Whether an immediate end is requested.
    fn is_abort_requested(&self) -> bool;
}

/// Makes the analysis of a run: with everything that a report shows, or with what a verdict needs alone.
pub type StartAnalysis = fn(&Scenario, &Declared) -> Analysis;

/// Plays a run and records it. The run ends as one with processes does, also when the user stops it. Enters the
/// ending and what the controller declares into the manifest.
pub fn record(
    plan: &RunPlan,
    folder: &RunFolder,
    build: BuildController,
    manifest: &mut Manifest,
    interrupts: &dyn Requests,
) -> anyhow::Result<()> {
    let run = Run::new(plan, build, manifest)?;
    let scene = Scene::new(&plan.mechanism, &plan.scenario.jaw);
    let mut recorder = Recorder::of_run(folder, scene)?;
    recorder.declare(run.duties.named.settings().declared())?;
    let (backlog, ending) = run.play(plan, Backlog::start(recorder, Pace::Virtual), interrupts)?;
    manifest.ending = ending;
    if let Some(loss) = backlog.finish().loss() {
        status!("masseter: {loss}; the run ends here");
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
    let run = Run::new(plan, build, manifest)?;
    let stream = Stream::new(start(&plan.scenario, &manifest.declared));
    let (stream, ending) = run.play(plan, stream, interrupts)?;
    manifest.ending = ending;
    stream.figures().context("a message on topic 'frame' holds no CAN frame")
}

/// The controller of a run that has not begun.
struct Run {
    controller: Box<dyn Controller>,
    duties: Duties,
}

impl Run {
    fn new(plan: &RunPlan, build: BuildController, manifest: &mut Manifest) -> anyhow::Result<Self> {
        let mut controller = build(&plan.scenario, plan.mechanism.clone(), plan.trajectory.clone());
        let named = NamedValues::new(controller.declared(), &plan.scenario.parameters)?;
        set_parameters(&mut *controller, &named);
        manifest.declared = named.settings().declared().clone();
        let operator = Operator::new(&plan.scenario, &manifest.declared, EPOCH_NS)?;
        Ok(Self { controller, duties: Duties { named, operator } })
    }

    /// Plays the run to its end; returns the sink and the ending. The ending counts only if the sink took every
    /// message.
    fn play<S: Sink>(
        self,
        plan: &RunPlan,
        sink: S,
        interrupts: &dyn Requests,
    ) -> anyhow::Result<(S, Ending)> {
        let Self { mut controller, mut duties } = self;
        let mut rig = Stepper::new(&plan.scenario, plan.schedule, sink)?;
        let mut plant_error = None;
        while plant_error.is_none()
            && controller.outcome().is_none()
            && !rig.sink_mut().has_failed()
            && !interrupts.is_abort_requested()
        {
            if interrupts.is_stop_requested() {
                controller.request_stop();
            }
            plant_error = rig.play_cycle(&mut *controller, &mut duties).err();
        }
        let ending = match (plant_error, controller.outcome()) {
            (Some(error), _) => Ending::died(Party::Plant.name(), error.to_string()),
            _ if interrupts.is_stop_requested() => Ending::Interrupted,
            (None, Some(Outcome::SafeStop)) => Ending::SafeStop,
            (None, _) => Ending::Completed,
        };
        Ok((rig.into_sink(), ending))
    }
}
