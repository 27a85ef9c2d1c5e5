//! A controller as a process: binds it to iceoryx2, and to real time or to lockstep. It decides nothing.

use super::{Controller, ControllerPorts, Outcome, run_cycle};
use crate::config::Scenario;
use crate::lifecycle::{Party, ProcessArguments, ProcessContext, ProcessError};
use crate::lockstep::{Clock, Lockstep};
use crate::messages::{Command, Event, Reading, State};
use crate::realtime::{Cycle, Wake};
use crate::transport::{Publisher, ReceivedMessage, Subscriber, TransportError};

/// Runs the controller that `build` makes, until it is done.
///
/// ```no_run
/// use masseter_shared::config::Scenario;
/// use masseter_shared::control::{Controller, Outcome, process};
/// use masseter_shared::lifecycle::{ProcessArguments, ProcessError};
///
/// fn control(build: fn(&Scenario) -> Box<dyn Controller>) -> Result<Outcome, ProcessError> {
///     let arguments = ProcessArguments { scenario: "scenario.toml".into(), domain: "bench".into(), lockstep: None };
///     process::run(&arguments, |scenario| Ok(build(scenario)))
/// }
/// ```
///
/// # Errors
/// Those of `build`, and [`ProcessError`] when the process cannot start or loses its messages.
pub fn run<E: From<ProcessError>>(
    arguments: &ProcessArguments,
    build: impl FnOnce(&Scenario) -> Result<Box<dyn Controller>, E>,
) -> Result<Outcome, E> {
    let context = arguments.init()?;
    let mut controller = build(&context.scenario)?;
    Ok(run_to_end(&context, &mut *controller)?)
}

fn run_to_end(context: &ProcessContext, controller: &mut dyn Controller) -> Result<Outcome, ProcessError> {
    let mut ports = Ports::open(context)?;
    loop {
        if let Some(outcome) = controller.outcome() {
            return Ok(outcome);
        }
        if context.stop.is_made() {
            controller.request_stop();
        }
        let wake = ports.wait(controller)?;
        run_cycle(controller, &mut ports, &wake)?;
        ports.end_cycle(controller.outcome().is_some())?;
    }
}

/// The controller's ports on iceoryx2, and the deadlines of its cycles.
struct Ports {
    readings: Subscriber<Reading>,
    commands: Publisher<Command>,
    states: Publisher<State>,
    events: Publisher<Event>,
    clock: Clock,
    /// From the deadline until the newest reading is used, whichever that is, ns.
    reading_timeout_ns: u64,
}

impl Ports {
    /// Opens the ports, reports ready, and connects to the ports of the other processes before the first cycle, since a
    /// connection makes and maps files.
    fn open(context: &ProcessContext) -> Result<Self, ProcessError> {
        let (node, scenario, schedule) = (&context.node, &context.scenario, &context.schedule);
        let readings = node.newest_subscriber()?;
        let (commands, states) = (node.publisher::<Command>()?, node.publisher::<State>()?);
        let events = node.publisher::<Event>()?;
        commands.warm_up()?;
        states.warm_up()?;
        events.warm_up()?;
        let lockstep = context
            .lockstep
            .map(|patience| Lockstep::open(context, patience, Party::Controller, Party::Plant));
        let lockstep = lockstep.transpose()?;
        let start = context.ready(Some(scenario.realtime.cores[0]))?;
        readings.connect()?;
        commands.connect()?;
        states.connect()?;
        events.connect()?;
        let first_due_ns = start.epoch_ns + schedule.controller_at_ns;
        let clock = match lockstep {
            None => Clock::RealTime(Cycle::new(first_due_ns, scenario.period_ns())),
            Some(mut lockstep) => {
                lockstep.start(first_due_ns);
                Clock::Lockstep(lockstep)
            }
        };
        Ok(Self {
            readings,
            commands,
            states,
            events,
            clock,
            reading_timeout_ns: (schedule.command_by_ns - schedule.controller_at_ns) / 2,
        })
    }

    /// Waits for the next deadline. Before it, warms the controller up and touches the memory of the next messages.
    fn wait(&mut self, controller: &dyn Controller) -> Result<Wake, TransportError> {
        match &mut self.clock {
            Clock::RealTime(cycle) => cycle.wait_warm(|| {
                controller.warm_up();
                self.commands.warm_up()?;
                self.states.warm_up()
            }),
            Clock::Lockstep(lockstep) => Ok(lockstep.begin_cycle()),
        }
    }

    /// Ends the controller's turn in lockstep.
    fn end_cycle(&mut self, is_last: bool) -> Result<(), ProcessError> {
        match &mut self.clock {
            Clock::RealTime(_) => Ok(()),
            Clock::Lockstep(lockstep) => Ok(lockstep.end_turn(is_last)?),
        }
    }
}

impl ControllerPorts for Ports {
    type Reading = ReceivedMessage<Reading>;
    type Error = ProcessError;

    fn now_ns(&self) -> u64 {
        self.clock.now_ns()
    }

    fn reading(&mut self, wake: &Wake) -> Result<Option<ReceivedMessage<Reading>>, ProcessError> {
        let is_awaited = |reading: &Reading| reading.cycle >= wake.cycle;
        let reading = match &mut self.clock {
            Clock::RealTime(cycle) => {
                let deadline_ns = wake.due_ns + self.reading_timeout_ns;
                self.readings.latest_by(deadline_ns, cycle.waiter(), is_awaited)?
            }
            Clock::Lockstep(lockstep) => {
                if !lockstep.await_turn()? {
                    return Ok(None);
                }
                self.readings.latest_by(0, lockstep.waiter(), is_awaited)?
            }
        };
        Ok(reading.map(ReceivedMessage::checked).transpose()?)
    }

    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), ProcessError> {
        Ok(self.commands.publish_by(|| self.clock.now_ns(), fill)?)
    }

    fn publish_state(&mut self, fill: impl FnOnce(&mut State)) -> Result<(), ProcessError> {
        Ok(self.states.publish_by(|| self.clock.now_ns(), fill)?)
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), ProcessError> {
        Ok(self.events.publish_by(|| self.clock.now_ns(), |message| *message = *event)?)
    }
}
