//! The run under virtual time: the same cores in one thread, as fast as they go. Its messages go to a [`Sink`].
//!
//! A crate of its own, since the whole cycle is compiled where its ports are known: here, fully optimised.
//!
//! Every step happens exactly when the time table has it, so the same scenario and seed leave the
//! same bytes. Computing takes no time here, and readings and commands go out when the time table has them at the
//! latest: what varies is the bus.

mod log;

use anyhow::Context;
use masseter_analysis::{Analysis, Figures};
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_plant::core::PlantCore;
use masseter_plant::cycle::PlantPorts;
use masseter_plant::emulation::VirtualLink;
use masseter_recording::{Backlog, Ending, Manifest, Pace, Recorder, RunFolder, Scene};
use masseter_runtime::control::{Controller, Duties, Operator, Outcome, set_parameters};
use masseter_runtime::lifecycle::Party;
use masseter_runtime::lockstep::EPOCH_NS;
use masseter_runtime::messages::{Command, Contact, Reading, Truth};
use masseter_runtime::named::{Declared, NamedValues};
use masseter_runtime::realtime::Wake;
use masseter_runtime::schedule::CycleSchedule;
use masseter_scenario::Scenario;
use masseter_terminal::status;

use log::{Publisher, Stream};

pub use log::{Log, LoggedPorts, Sink};

/// What the user asks of a run.
pub trait Requests {
    /// Whether an orderly stop is requested.
    fn is_stop_requested(&self) -> bool;

    /// Whether an immediate end is requested.
    fn is_abort_requested(&self) -> bool;
}

/// Makes the analysis of a run: with everything that a report shows, or with what a verdict needs alone.
pub type StartAnalysis = fn(&Scenario, &Declared) -> Analysis;

/// Runs the rig and records the run; it ends as the processes would, also when the user stops it. Enters the ending and what
/// the controller declares into the manifest.
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

/// The same without a recording: the figures of the run.
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

    /// Plays the motion; returns the sink, and how the run ended if the sink took everything.
    fn play<S: Sink>(
        self,
        plan: &RunPlan,
        sink: S,
        interrupts: &dyn Requests,
    ) -> anyhow::Result<(S, Ending)> {
        let Self { controller, duties } = self;
        let scenario = &plan.scenario;
        let mut plant = PlantCore::new(scenario, EPOCH_NS)?;
        let log = Log::new(sink);
        let mut rig =
            VirtualRig { controller, duties, schedule: &plan.schedule, log, now_ns: EPOCH_NS, reading: None };

        let (mut cycle, mut plant_error) = (0, None);
        while plant_error.is_none()
            && rig.controller.outcome().is_none()
            && !rig.log.sink_mut().has_failed()
            && !interrupts.is_abort_requested()
        {
            cycle += 1;
            if interrupts.is_stop_requested() {
                rig.controller.request_stop();
            }
            let sync = Wake::on_time(cycle, EPOCH_NS + (cycle - 1) * scenario.period_ns());
            plant_error = masseter_plant::cycle::run_cycle(&mut plant, &mut rig, &plan.schedule, &sync).err();
        }
        let ending = match (plant_error, rig.controller.outcome()) {
            (Some(error), _) => Ending::died(Party::Plant.name(), error.to_string()),
            _ if interrupts.is_stop_requested() => Ending::Interrupted,
            (None, Some(Outcome::SafeStop)) => Ending::SafeStop,
            (None, _) => Ending::Completed,
        };
        Ok((rig.log.into_sink(), ending))
    }
}

/// Both sides of the rig in one thread: the controller's cycle runs where the plant waits for its command.
struct VirtualRig<'a, S> {
    controller: Box<dyn Controller>,
    duties: Duties,
    schedule: &'a CycleSchedule,
    log: Log<S>,
    now_ns: u64,
    /// The reading of this cycle, as published.
    reading: Option<Reading>,
}

impl<S: Sink> PlantPorts<VirtualLink> for VirtualRig<'_, S> {
    type Command = Command;
    type Error = PlantError;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn wait_until(&mut self, _: u64, latest_ns: u64) -> u64 {
        self.now_ns = latest_ns;
        latest_ns
    }

    fn wait_for_frames(&mut self, _: &mut VirtualLink, latest_ns: u64) -> u64 {
        latest_ns
    }

    fn publish_reading(&mut self, fill: impl FnOnce(&mut Reading)) -> Result<(), PlantError> {
        self.reading = Some(self.log.record(Publisher::Reading, self.now_ns, fill));
        Ok(())
    }

    fn publish_truth(&mut self, truth: &Truth) -> Result<(), PlantError> {
        self.log.record(Publisher::Truth, self.now_ns, |message| *message = *truth);
        Ok(())
    }

    fn publish_contact(&mut self, contact: &Contact) -> Result<(), PlantError> {
        self.log.record(Publisher::Contact, self.now_ns, |message| *message = *contact);
        Ok(())
    }

    fn command(&mut self, sync: &Wake) -> Result<Option<Command>, PlantError> {
        self.now_ns = sync.due_ns + self.schedule.controller_at_ns;
        let wake = Wake::on_time(sync.cycle, self.now_ns);
        let (reading, now_ns) = (self.reading.take(), self.now_ns);
        let mut ports = LoggedPorts::new(&mut self.log, [now_ns; 3], reading.as_ref());
        let Ok(()) =
            masseter_runtime::control::run_cycle(&mut *self.controller, &mut self.duties, &mut ports, &wake);
        Ok(ports.into_command())
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore) -> Result<(), PlantError> {
        self.log.drain(plant, self.now_ns);
        Ok(())
    }
}
