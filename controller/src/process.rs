//! The controller's process: binds the pure core to iceoryx2 and to real time, and decides nothing.

use masseter_shared::clock;
use masseter_shared::geometry::{GeometryError, Mechanism};
use masseter_shared::lifecycle::{Assignment, ProcessError};
use masseter_shared::messages::codes::ControllerState;
use masseter_shared::messages::{Command, Event, Reading, State};
use masseter_shared::realtime::{Cycle, Waiter, Wake};
use masseter_shared::transport::{Inlet, Node, Outlet};

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

/// Why the controller could not do its work.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// What any process may meet.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The motion.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

/// The controller's ports.
struct Ports {
    readings: Inlet<Reading>,
    commands: Outlet<Command>,
    states: Outlet<State>,
    events: Outlet<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, ProcessError> {
        let ports = Self {
            readings: node.newest_inlet()?,
            commands: node.outlet()?,
            states: node.outlet()?,
            events: node.outlet()?,
        };
        ports.commands.warm_up()?;
        ports.states.warm_up()?;
        ports.events.warm_up()?;
        Ok(ports)
    }

    /// Once everybody's ports are there, so that no cycle has to.
    fn connect(&self) -> Result<(), ProcessError> {
        self.readings.connect()?;
        self.commands.connect()?;
        self.states.connect()?;
        Ok(self.events.connect()?)
    }
}

/// Runs the controller until its part is done.
pub fn run(assignment: &Assignment) -> Result<Outcome, ControllerError> {
    let post = assignment.take_up()?;
    let (scenario, schedule) = (&post.scenario, &post.schedule);
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
    let mut controller = Controller::new(scenario, mechanism, trajectory);
    let mut ports = Ports::open(&post.node)?;
    let start = post.ready_on(scenario.realtime.cores[0])?;
    ports.connect()?;

    let mut cycle = Cycle::new(start.epoch_ns + schedule.controller_at_ns, scenario.period_ns());
    let reading_timeout_ns = (schedule.command_by_ns - schedule.controller_at_ns) / 2;
    while !controller.is_done() {
        if post.stop.is_made() {
            controller.request_stop();
        }
        let wake = cycle.wait_warm(|| warm_up(&controller, &ports))?;
        step(&mut controller, &mut ports, wake, reading_timeout_ns, cycle.waiter())?;
    }
    match controller.state() {
        ControllerState::SafeStop => Ok(Outcome::SafeStop),
        _ => Ok(Outcome::Finished),
    }
}

/// Solves the last cycle's kinematics and touches the memory of the next messages.
fn warm_up(controller: &Controller, ports: &Ports) -> Result<(), ProcessError> {
    controller.warm_up();
    ports.commands.warm_up()?;
    Ok(ports.states.warm_up()?)
}

/// One cycle.
fn step(
    controller: &mut Controller,
    ports: &mut Ports,
    wake: Wake,
    reading_timeout_ns: u64,
    waiter: &mut Waiter,
) -> Result<(), ProcessError> {
    let deadline_ns = wake.due_ns + reading_timeout_ns;
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
        (state.skipped_cycles, state.stalled_ns) = (wake.skipped, wake.account.stalled_ns);
        (state.spun_ns, state.worked_ns) = (wake.account.spun_ns, wake.account.worked_ns);
        state.overlong_ns = wake.account.overlong_ns;
        (state.received_ns, state.solved_ns, state.commanded_ns) = (received_ns, solved_ns, commanded_ns);
    })?;
    if let Some(event) = event {
        ports.events.publish(|message| *message = event)?;
    }
    Ok(())
}
