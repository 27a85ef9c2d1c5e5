//! A controller as a process: binds it to iceoryx2 and to real time, and decides nothing.

use super::{Controller, ControllerPorts, Outcome, run_cycle};
use crate::clock;
use crate::config::Scenario;
use crate::lifecycle::{ProcessArguments, ProcessError};
use crate::messages::{Command, Event, Reading, State};
use crate::realtime::{Cycle, Wake};
use crate::transport::{Node, Publisher, Received, Subscriber, TransportError};

/// Runs the controller that `build` makes, until it is done.
///
/// # Errors
/// Those of `build`, and [`ProcessError`] when the process cannot start or loses its messages.
pub fn run<C: Controller, E: From<ProcessError>>(
    arguments: &ProcessArguments,
    build: impl FnOnce(&Scenario) -> Result<C, E>,
) -> Result<Outcome, E> {
    let context = arguments.init()?;
    let (scenario, schedule) = (&context.scenario, &context.schedule);
    let mut controller = build(scenario)?;
    let ports = Ports::open(&context.node).map_err(ProcessError::from)?;
    ports.warm_up(&controller).map_err(ProcessError::from)?;
    let start = context.ready(Some(scenario.realtime.cores[0]))?;
    ports.connect().map_err(ProcessError::from)?;

    let mut real_time = RealTime {
        ports,
        cycle: Cycle::new(start.epoch_ns + schedule.controller_at_ns, scenario.period_ns()),
        reading_timeout_ns: (schedule.command_by_ns - schedule.controller_at_ns) / 2,
    };
    loop {
        if let Some(outcome) = controller.outcome() {
            return Ok(outcome);
        }
        if context.stop.is_made() {
            controller.request_stop();
        }
        let RealTime { ports, cycle, .. } = &mut real_time;
        let wake = cycle.wait_warm(|| ports.warm_up(&controller)).map_err(ProcessError::from)?;
        run_cycle(&mut controller, &mut real_time, &wake).map_err(ProcessError::from)?;
    }
}

/// The ports and the deadlines of the controller's cycles.
struct RealTime {
    ports: Ports,
    cycle: Cycle,
    /// From the deadline until the newest reading is used, whichever that is, ns.
    reading_timeout_ns: u64,
}

/// The controller's ports on iceoryx2.
struct Ports {
    readings: Subscriber<Reading>,
    commands: Publisher<Command>,
    states: Publisher<State>,
    events: Publisher<Event>,
}

impl Ports {
    fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self {
            readings: node.newest_subscriber()?,
            commands: node.publisher()?,
            states: node.publisher()?,
            events: node.publisher()?,
        })
    }

    /// Connects to the ports of the other processes before the first cycle, since a connection makes and maps files.
    fn connect(&self) -> Result<(), TransportError> {
        self.readings.connect()?;
        self.commands.connect()?;
        self.states.connect()?;
        self.events.connect()
    }

    /// Warms the controller up, and touches the memory of the next messages.
    fn warm_up(&self, controller: &impl Controller) -> Result<(), TransportError> {
        controller.warm_up();
        self.commands.warm_up()?;
        self.states.warm_up()?;
        self.events.warm_up()
    }
}

impl ControllerPorts for RealTime {
    type Reading = Received<Reading>;
    type Error = TransportError;

    fn now_ns(&self) -> u64 {
        clock::now_ns()
    }

    fn reading(&mut self, wake: &Wake) -> Result<Option<Received<Reading>>, TransportError> {
        let deadline_ns = wake.due_ns + self.reading_timeout_ns;
        let is_awaited = |reading: &Reading| reading.cycle >= wake.cycle;
        self.ports.readings.latest_by(deadline_ns, self.cycle.waiter(), is_awaited)
    }

    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), TransportError> {
        self.ports.commands.publish(fill)
    }

    fn publish_state(&mut self, fill: impl FnOnce(&mut State)) -> Result<(), TransportError> {
        self.ports.states.publish(fill)
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), TransportError> {
        self.ports.events.publish(|message| *message = *event)
    }
}
