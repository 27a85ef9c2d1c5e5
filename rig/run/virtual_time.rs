//! The run under virtual time: the same cores in one thread, as fast as they go. Its messages go to a [`Sink`].
//!
//! Every step happens exactly when the time table has it, so the same scenario and seed leave the
//! same bytes. Computing takes no time here, and readings and commands go out when the time table has them at the
//! latest: what varies is the bus.

use std::convert::Infallible;

use anyhow::Context;
use masseter_analysis::{Analysis, Figures};
use masseter_controller::process::BuildController;
use masseter_plan::RunPlan;
use masseter_plant::PlantError;
use masseter_plant::core::PlantCore;
use masseter_plant::cycle::PlantPorts;
use masseter_plant::emulation::VirtualLink;
use masseter_recording::{Backlog, Ending, Manifest, Pace, Recorded, Recorder, RunFolder, Scene};
use masseter_shared::control::{Controller, ControllerPorts, Duties, Operator, Outcome, set_parameters};
use masseter_shared::lockstep::EPOCH_NS;
use masseter_shared::messages::{
    Command, Contact, Event, Message, Parameters, Reading, Signals, State, Truth,
};
use masseter_shared::named::NamedValues;
use masseter_shared::realtime::Wake;
use masseter_shared::schedule::CycleSchedule;
use masseter_terminal::status;

use super::child::PLANT;
use super::sink::{Sink, Stream};
use crate::machine::interrupts::Interrupts;

/// Runs the rig and records the run; it ends as the processes would, also when the user stops it. Enters the ending and what
/// the controller declares into the manifest.
pub(super) fn record(
    plan: &RunPlan,
    folder: &RunFolder,
    build: BuildController,
    manifest: &mut Manifest,
    interrupts: &Interrupts,
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
pub(super) fn analyse(
    plan: &RunPlan,
    build: BuildController,
    manifest: &mut Manifest,
    interrupts: &Interrupts,
) -> anyhow::Result<Figures> {
    let run = Run::new(plan, build, manifest)?;
    let stream = Stream::new(Analysis::without_report(&plan.scenario, &manifest.declared));
    let (stream, ending) = run.play(plan, stream, interrupts)?;
    manifest.ending = ending;
    stream.finish().context("a message on topic 'frame' holds no CAN frame")
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
    fn play<S: Sink>(self, plan: &RunPlan, sink: S, interrupts: &Interrupts) -> anyhow::Result<(S, Ending)> {
        let Self { controller, duties } = self;
        let scenario = &plan.scenario;
        let mut plant = PlantCore::new(scenario, EPOCH_NS)?;
        let log = Log { sink, published: Default::default() };
        let mut rig =
            VirtualRig { controller, duties, schedule: &plan.schedule, log, now_ns: EPOCH_NS, reading: None };

        let (mut cycle, mut plant_error) = (0, None);
        while plant_error.is_none()
            && rig.controller.outcome().is_none()
            && !rig.log.sink.has_failed()
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
            (Some(error), _) => Ending::died(PLANT, error.to_string()),
            _ if interrupts.is_stop_requested() => Ending::Interrupted,
            (None, Some(Outcome::SafeStop)) => Ending::SafeStop,
            (None, _) => Ending::Completed,
        };
        Ok((rig.log.sink, ending))
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
        let mut ports = VirtualPorts { log: &mut self.log, now_ns, reading, command: None };
        let Ok(()) =
            masseter_shared::control::run_cycle(&mut *self.controller, &mut self.duties, &mut ports, &wake);
        Ok(ports.command)
    }

    fn publish_frames_and_events(&mut self, plant: &mut PlantCore) -> Result<(), PlantError> {
        self.log.drain(plant, self.now_ns);
        Ok(())
    }
}

/// The controller's side of a cycle.
struct VirtualPorts<'a, S> {
    log: &'a mut Log<S>,
    now_ns: u64,
    reading: Option<Reading>,
    command: Option<Command>,
}

impl<S: Sink> ControllerPorts for VirtualPorts<'_, S> {
    type Reading = Reading;
    type Error = Infallible;

    fn now_ns(&self) -> u64 {
        self.now_ns
    }

    fn reading(&mut self, _: &Wake) -> Result<Option<Reading>, Infallible> {
        Ok(self.reading.take())
    }

    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), Infallible> {
        self.command = Some(self.log.record(Publisher::Command, self.now_ns, fill));
        Ok(())
    }

    fn publish_state(&mut self, fill: impl FnOnce(&mut State)) -> Result<(), Infallible> {
        self.log.record(Publisher::State, self.now_ns, fill);
        Ok(())
    }

    fn publish_signals(&mut self, fill: impl FnOnce(&mut Signals)) -> Result<(), Infallible> {
        self.log.record(Publisher::Signals, self.now_ns, fill);
        Ok(())
    }

    fn publish_parameters(&mut self, fill: impl FnOnce(&mut Parameters)) -> Result<(), Infallible> {
        self.log.record(Publisher::Parameters, self.now_ns, fill);
        Ok(())
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), Infallible> {
        self.log.record(Publisher::ControllerEvent, self.now_ns, |message| *message = *event);
        Ok(())
    }
}

/// The publishers of a run. Each numbers its own messages.
#[derive(Clone, Copy)]
enum Publisher {
    Command,
    Reading,
    State,
    Signals,
    Parameters,
    Truth,
    Contact,
    Frame,
    ControllerEvent,
    PlantEvent,
}

/// The sink, and how many messages of each publisher it took.
struct Log<S> {
    sink: S,
    published: [u64; Publisher::PlantEvent as usize + 1],
}

impl<S: Sink> Log<S> {
    /// Numbers a message, as its publisher would, and hands it on.
    fn record<M: Message + Into<Recorded>>(
        &mut self,
        publisher: Publisher,
        now_ns: u64,
        fill: impl FnOnce(&mut M),
    ) -> M {
        let mut message = M::default();
        fill(&mut message);
        let number = &mut self.published[publisher as usize];
        *number += 1;
        message.stamp(*number, now_ns);
        self.sink.take(&message.into(), now_ns);
        message
    }

    /// Hands on the frames and events of a cycle.
    fn drain(&mut self, plant: &mut PlantCore, now_ns: u64) {
        for frame in plant.drain_frames() {
            self.record(Publisher::Frame, now_ns, |message| *message = frame);
        }
        plant.drain_events(&mut |event| {
            self.record(Publisher::PlantEvent, now_ns, |message| *message = event);
        });
    }
}
