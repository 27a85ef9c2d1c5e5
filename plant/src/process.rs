//! The plant's process: binds the pure core to iceoryx2 and to real time, and decides nothing.

use masseter_shared::clock;
use masseter_shared::config::Scenario;
use masseter_shared::lifecycle::{Assignment, AssignmentError, StartError, StopRequest, ready_and_wait};
use masseter_shared::messages::{Command, Event, FrameTap, Reading, Truth};
use masseter_shared::realtime::scheduling::{Wanted, obtain};
use masseter_shared::realtime::{Cycle, Waiter, Wake};
use masseter_shared::schedule::{CycleSchedule, ScheduleError};
use masseter_shared::transport::{Inlet, Node, Outlet, TransportError};

use crate::core::{PlantCore, PlantError};

/// How long the drives may take to stop after the end has been asked for, ns.
const STOP_WITHIN_NS: u64 = 500_000_000;

/// Why the process could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum ProcessError {
    /// Scenario or domain.
    #[error(transparent)]
    Assignment(#[from] AssignmentError),
    /// The plant itself.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The CAN link's time table.
    #[error(transparent)]
    Schedule(#[from] ScheduleError),
    /// iceoryx2.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The supervisor.
    #[error(transparent)]
    Start(#[from] StartError),
    /// Signals cannot be received.
    #[error("cannot listen for signals: {0}")]
    Signals(#[from] std::io::Error),
}

/// The plant's ports.
struct Ports {
    commands: Inlet<Command>,
    readings: Outlet<Reading>,
    truths: Outlet<Truth>,
    frames: Outlet<FrameTap>,
    events: Outlet<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, TransportError> {
        let ports = Self {
            commands: node.inlet()?,
            readings: node.outlet()?,
            truths: node.outlet()?,
            frames: node.outlet()?,
            events: node.outlet()?,
        };
        ports.readings.warm_up()?;
        ports.truths.warm_up()?;
        ports.frames.warm_up()?;
        ports.events.warm_up()?;
        Ok(ports)
    }
}

/// Runs the plant until it is asked to end, then until its drives are off.
pub fn run(assignment: &Assignment) -> Result<(), ProcessError> {
    let (scenario, domain) = assignment.open()?;
    let stop = StopRequest::listen()?;
    let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns())?;
    // Built once before the start, so that a plant that cannot be built is never reported ready.
    PlantCore::new(&scenario, 0)?;
    let node = Node::join(&domain)?;
    let mut ports = Ports::open(&node)?;
    let start = ready_and_wait(obtain(wanted(&scenario)))?;

    let mut plant = PlantCore::new(&scenario, start.epoch_ns)?;
    let mut cycle = Cycle::new(start.epoch_ns, scenario.period_ns());
    while !stop.is_made() {
        let wake = cycle.wait();
        exchange(&mut plant, &mut ports, &schedule, wake, cycle.waiter())?;
        let deadline_ns = wake.due_ns + schedule.command_by_ns;
        let command =
            ports.commands.latest_by(deadline_ns, cycle.waiter(), |command| command.cycle >= wake.cycle)?;
        plant.apply(clock::now_ns(), command.as_deref())?;
    }
    // Without commands the master stops the drives.
    let give_up_ns = clock::now_ns() + STOP_WITHIN_NS;
    while !plant.drives_are_off() && clock::now_ns() < give_up_ns {
        let wake = cycle.wait();
        exchange(&mut plant, &mut ports, &schedule, wake, cycle.waiter())?;
        plant.apply(clock::now_ns(), None)?;
    }
    Ok(())
}

fn wanted(scenario: &Scenario) -> Wanted {
    let realtime = &scenario.realtime;
    Wanted {
        core: Some(realtime.cores[1]),
        fifo_priority: Some(realtime.priority),
        locked_memory: realtime.lock_memory,
    }
}

/// SYNC, the drives' process data, and what the cycle publishes.
fn exchange(
    plant: &mut PlantCore,
    ports: &mut Ports,
    schedule: &CycleSchedule,
    wake: Wake,
    waiter: &mut Waiter,
) -> Result<(), ProcessError> {
    plant.begin_cycle(wake)?;
    // SYNC went out when the process woke; a late one shifts what follows, so that the reading is late
    // but complete. Process data take at least half of their worst case.
    let reading_by_ns = wake.woke_ns + schedule.reading_by_ns;
    let mut now_ns = waiter.until(wake.woke_ns + schedule.reading_by_ns / 2);
    let mut spin = waiter.spin();
    while !plant.collect(now_ns)? && now_ns < reading_by_ns {
        now_ns = spin.now_ns();
    }
    ports.readings.publish(|reading| plant.fill_reading(reading))?;
    ports.truths.publish(|truth| plant.fill_truth(truth))?;
    let mut result = Ok(());
    plant.drain_frames(&mut |frame| {
        if result.is_ok() {
            result = ports.frames.publish(|message| *message = frame);
        }
    });
    plant.drain_events(&mut |event| {
        if result.is_ok() {
            result = ports.events.publish(|message| *message = event);
        }
    });
    Ok(result?)
}
