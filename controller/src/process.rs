//! The controller's process: binds the pure core to iceoryx2 and to real time, and decides nothing.

use masseter_shared::clock;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::{GeometryError, Mechanism};
use masseter_shared::lifecycle::{Assignment, AssignmentError, StartError, StopRequest, ready_and_wait};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Event, Reading, State};
use masseter_shared::realtime::scheduling::{Wanted, obtain};
use masseter_shared::realtime::{Cycle, Waiter, Wake};
use masseter_shared::schedule::{CycleSchedule, ScheduleError};
use masseter_shared::transport::{Inlet, Node, Outlet, TransportError};

use crate::core::{Controller, Tick};
use crate::trajectory::{Trajectory, TrajectoryError};

/// How the controller's part ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The motion was played, or stopped on request, and the drives are off.
    Finished,
    /// A fault ended it.
    SafeStop,
}

/// Why the process could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// Scenario or domain.
    #[error(transparent)]
    Assignment(#[from] AssignmentError),
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The motion.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
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

/// The controller's ports.
struct Ports {
    readings: Inlet<Reading>,
    commands: Outlet<Command>,
    states: Outlet<State>,
    events: Outlet<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, TransportError> {
        let ports = Self {
            readings: node.inlet()?,
            commands: node.outlet()?,
            states: node.outlet()?,
            events: node.outlet()?,
        };
        ports.commands.warm_up()?;
        ports.states.warm_up()?;
        ports.events.warm_up()?;
        Ok(ports)
    }
}

/// Runs the controller until its part is done.
pub fn run(assignment: &Assignment) -> Result<Outcome, ControllerError> {
    let (scenario, domain) = assignment.open()?;
    let stop = StopRequest::listen()?;
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
    let mut controller = Controller::new(&scenario, mechanism, trajectory);
    let schedule = CycleSchedule::new(&scenario.can, scenario.period_ns())?;
    let node = Node::join(&domain)?;
    let mut ports = Ports::open(&node)?;
    let start = ready_and_wait(obtain(wanted(&scenario)))?;

    let mut cycle = Cycle::new(start.epoch_ns + schedule.controller_at_ns, scenario.period_ns());
    let patience_ns = (schedule.command_by_ns - schedule.controller_at_ns) / 2;
    while !controller.is_done() {
        if stop.is_made() {
            controller.request_stop();
        }
        let wake = cycle.wait();
        step(&mut controller, &mut ports, wake, patience_ns, cycle.waiter())?;
    }
    match controller.state() {
        ControllerState::SafeStop => Ok(Outcome::SafeStop),
        _ => Ok(Outcome::Finished),
    }
}

fn wanted(scenario: &Scenario) -> Wanted {
    let realtime = &scenario.realtime;
    Wanted {
        core: Some(realtime.cores[0]),
        fifo_priority: Some(realtime.priority),
        locked_memory: realtime.lock_memory,
    }
}

/// One cycle.
fn step(
    controller: &mut Controller,
    ports: &mut Ports,
    wake: Wake,
    patience_ns: u64,
    waiter: &mut Waiter,
) -> Result<(), TransportError> {
    let deadline_ns = wake.due_ns + patience_ns;
    let reading = ports.readings.latest_by(deadline_ns, waiter, |reading| reading.cycle >= wake.cycle)?;
    let received_ns = clock::now_ns();
    controller.observe(reading.as_deref());
    let solved_ns = clock::now_ns();
    let event = controller.decide(Tick { cycle: wake.cycle, now_ns: solved_ns });
    let commanded_ns = clock::now_ns();
    ports.commands.publish(|command| controller.fill_command(command))?;
    ports.states.publish(|state| {
        controller.fill_state(state);
        (state.due_ns, state.woke_ns) = (wake.due_ns, wake.woke_ns);
        (state.skipped_cycles, state.stalled_ns) = (wake.skipped, wake.stalled_ns);
        (state.received_ns, state.solved_ns, state.commanded_ns) = (received_ns, solved_ns, commanded_ns);
    })?;
    match event {
        Some(event) => ports.events.publish(|message| *message = event),
        None => Ok(()),
    }
}
