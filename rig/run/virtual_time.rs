//! The run under virtual time: the same cores in one thread, as fast as they go, recorded by another.
//!
//! Every step happens exactly when the time table has it, so the same scenario and seed leave the
//! same bytes. Computing takes no time here, and readings and commands go out when the time table has them at the
//! latest: what varies is the bus.

use anyhow::Context;
use masseter_controller::core::{Controller, Tick};
use masseter_plan::Plan;
use masseter_plant::core::{PlantCore, PlantError};
use masseter_recording::{Backlog, Ending, Pace, Recorder, RunFolder, Scene};
use masseter_shared::clock::SECOND_NS;
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Message, State};
use masseter_shared::realtime::Wake;
use masseter_terminal::status;

use super::child::Role;
use crate::machine::interrupts::Interrupts;

/// Virtual time of the first SYNC, ns.
const EPOCH_NS: u64 = SECOND_NS;

/// Runs the rig under virtual time; it ends as the processes would, also when the user stops it.
pub fn run(plan: &Plan, folder: &RunFolder) -> anyhow::Result<Ending> {
    let interrupts = Interrupts::listen().context("cannot listen for signals")?;
    let ending = play(plan, folder, &interrupts);
    interrupts.let_go();
    ending
}

fn play(plan: &Plan, folder: &RunFolder, interrupts: &Interrupts) -> anyhow::Result<Ending> {
    let scenario = &plan.scenario;
    let mut plant = PlantCore::new(scenario, EPOCH_NS)?;
    let mut controller = Controller::new(scenario, plan.mechanism.clone(), plan.trajectory.clone());
    let scene = Scene::new(&plan.mechanism, &scenario.jaw);
    let mut log = Log::new(Backlog::start(Recorder::create(&folder.recording(), scene)?, Pace::Virtual));

    let (mut cycle, mut plant_error) = (0, None);
    while plant_error.is_none() && !controller.is_done() && log.is_safe() && !interrupts.is_end_insisted() {
        cycle += 1;
        if interrupts.is_stop_asked() {
            controller.request_stop();
        }
        let sync_ns = EPOCH_NS + (cycle - 1) * scenario.period_ns();
        plant_error = step(cycle, sync_ns, plan, &mut plant, &mut controller, &mut log).err();
    }
    let loss = log.backlog.finish().loss();
    if let Some(loss) = &loss {
        status!("masseter: {loss}; the run ends here");
    }
    Ok(match (plant_error, controller.state()) {
        (Some(error), _) => Ending::died(Role::Plant.name(), error.to_string()),
        _ if loss.is_some() => Ending::RecordingFailed,
        _ if interrupts.is_stop_asked() => Ending::Interrupted,
        (None, ControllerState::SafeStop) => Ending::SafeStop,
        (None, _) => Ending::Completed,
    })
}

/// One cycle: SYNC, process data, reading, controller, command.
fn step(
    cycle: u64,
    sync_ns: u64,
    plan: &Plan,
    plant: &mut PlantCore,
    controller: &mut Controller,
    log: &mut Log,
) -> Result<(), PlantError> {
    plant.begin_cycle(Wake::on_time(cycle, sync_ns))?;
    let reading_ns = sync_ns + plan.schedule.reading_by_ns;
    plant.collect(reading_ns)?;
    let reading = log.readings.record(&mut log.backlog, reading_ns, |reading| plant.fill_reading(reading));
    if let Some(truth) = plant.truth() {
        log.truths.record(&mut log.backlog, reading_ns, |message| *message = truth);
    }

    let now_ns = sync_ns + plan.schedule.controller_at_ns;
    controller.observe(Some(&reading));
    let event = controller.decide(Tick { cycle, now_ns });
    let command = log.commands.record(&mut log.backlog, now_ns, |command| controller.fill_command(command));
    log.states.record(&mut log.backlog, now_ns, |state: &mut State| {
        controller.fill_state(state);
        (state.due_ns, state.woke_ns, state.received_ns) = (now_ns, now_ns, now_ns);
        (state.solved_ns, state.commanded_ns) = (now_ns, now_ns);
    });
    if let Some(event) = event {
        log.controller_events.record(&mut log.backlog, now_ns, |message| *message = event);
    }
    plant.apply(now_ns, Some(&command))?;
    log.drain(plant, now_ns);
    Ok(())
}

/// Numbers and records the messages of one publisher on one topic, as its outlet would.
#[derive(Default)]
struct Outlet(u64);

impl Outlet {
    fn record<M: Message>(&mut self, backlog: &mut Backlog, now_ns: u64, fill: impl FnOnce(&mut M)) -> M {
        let mut message = M::default();
        fill(&mut message);
        self.0 += 1;
        message.stamp(self.0, now_ns);
        backlog.record(&message, now_ns);
        message
    }
}

/// The recording and the publishers it hears.
struct Log {
    backlog: Backlog,
    commands: Outlet,
    readings: Outlet,
    states: Outlet,
    truths: Outlet,
    frames: Outlet,
    controller_events: Outlet,
    plant_events: Outlet,
}

impl Log {
    fn new(backlog: Backlog) -> Self {
        Self {
            backlog,
            commands: Outlet::default(),
            readings: Outlet::default(),
            states: Outlet::default(),
            truths: Outlet::default(),
            frames: Outlet::default(),
            controller_events: Outlet::default(),
            plant_events: Outlet::default(),
        }
    }

    /// Whether everything so far is or will be recorded, as far as is known.
    fn is_safe(&self) -> bool {
        self.backlog.dropped() == 0
    }

    /// Records the frames and events of a cycle.
    fn drain(&mut self, plant: &mut PlantCore, now_ns: u64) {
        for frame in plant.drain_frames() {
            self.frames.record(&mut self.backlog, now_ns, |message| *message = frame);
        }
        plant.drain_events(&mut |event| {
            self.plant_events.record(&mut self.backlog, now_ns, |message| *message = event);
        });
    }
}
