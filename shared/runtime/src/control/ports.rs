//! The ports of a controller on iceoryx2, and the deadlines of its cycles. What a cycle does is the
//! [session](super::session)'s.

use std::time::Duration;

use super::ControllerPorts;
use crate::lifecycle::{Party, ProcessContext, ProcessError, Report, SupervisorLink};
use crate::lockstep::{Clock, Lockstep};
use crate::messages::{Command, Event, Parameters, Reading, Signals, State};
use crate::transport::{Publisher, ReceivedMessage, Subscriber, TransportError};
use crate::{clock, named::Declared, realtime::Wake};

/// The controller's ports on iceoryx2 and the deadlines of its cycles.
#[derive(Debug)]
pub(super) struct Ports {
    readings: Subscriber<Reading>,
    commands: Publisher<Command>,
    states: Publisher<State>,
    /// None without declared signals.
    signals: Option<Publisher<Signals>>,
    /// None without declared parameters.
    parameters: Option<Publisher<Parameters>>,
    events: Publisher<Event>,
    clock: Clock,
    link: SupervisorLink,
    /// Longest wait for a new reading after the deadline, ns; then the newest reading counts.
    reading_timeout_ns: u64,
}

impl Ports {
    /// Opens the ports, reports ready, and returns the time of the first SYNC, ns. The ports connect to the other
    /// processes before the first cycle, because a connection makes and maps files.
    pub(super) fn open(context: &ProcessContext, declared: &Declared) -> Result<(Self, u64), ProcessError> {
        let (node, scenario, schedule) = (&context.node, &context.scenario, &context.schedule);
        let readings = Subscriber::of_newest(node)?;
        let (commands, states) = (Publisher::<Command>::open(node)?, Publisher::<State>::open(node)?);
        let signals =
            if declared.signals.is_empty() { None } else { Some(Publisher::<Signals>::open(node)?) };
        let parameters =
            if declared.parameters.is_empty() { None } else { Some(Publisher::<Parameters>::open(node)?) };
        let events = Publisher::<Event>::open(node)?;
        commands.warm_up()?;
        states.warm_up()?;
        signals.as_ref().map_or(Ok(()), Publisher::warm_up)?;
        parameters.as_ref().map_or(Ok(()), Publisher::warm_up)?;
        events.warm_up()?;
        let lockstep = Lockstep::open(context, Party::Controller, Party::Plant)?;
        let start = context.ready(Some(scenario.realtime.cores[0]), declared.clone())?;
        readings.connect()?;
        commands.connect()?;
        states.connect()?;
        signals.as_ref().map_or(Ok(()), Publisher::connect)?;
        parameters.as_ref().map_or(Ok(()), Publisher::connect)?;
        events.connect()?;
        let first_due_ns = start.epoch_ns + schedule.controller_at_ns;
        let clock = Clock::start(lockstep, first_due_ns, scenario.period_ns());
        let ports = Self {
            readings,
            commands,
            states,
            signals,
            parameters,
            events,
            clock,
            link: context.link.clone(),
            reading_timeout_ns: (schedule.command_by_ns - schedule.controller_at_ns) / 2,
        };
        Ok((ports, start.epoch_ns))
    }

    /// Waits for the next deadline. Before it, calls `warm_up` and touches the memory of the next messages.
    pub(super) fn begin_cycle(&mut self, warm_up: impl FnOnce()) -> Result<Wake, TransportError> {
        match &mut self.clock {
            Clock::RealTime(cycle) => cycle.wait_warm(|| {
                warm_up();
                self.commands.warm_up()?;
                self.states.warm_up()?;
                self.signals.as_ref().map_or(Ok(()), Publisher::warm_up)
            }),
            Clock::Lockstep(lockstep) => Ok(lockstep.begin_cycle()),
        }
    }

    /// Whether the next cycle begins within this time; otherwise sleeps for that time.
    pub(super) fn begins_within(&mut self, timeout: Duration) -> Result<bool, ProcessError> {
        match &mut self.clock {
            Clock::RealTime(cycle) => {
                let begins = cycle.next_due_ns() <= clock::now_ns() + timeout.as_nanos() as u64;
                if !begins {
                    clock::sleep(timeout);
                }
                Ok(begins)
            }
            Clock::Lockstep(lockstep) => lockstep.is_turn_within(timeout),
        }
    }

    /// Ends the controller's turn in lockstep.
    pub(super) fn end_turn(&mut self, is_last: bool) -> Result<(), ProcessError> {
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

    fn publish_signals(&mut self, fill: impl FnOnce(&mut Signals)) -> Result<(), ProcessError> {
        let Some(signals) = &mut self.signals else { return Ok(()) };
        Ok(signals.publish_by(|| self.clock.now_ns(), fill)?)
    }

    fn publish_parameters(&mut self, fill: impl FnOnce(&mut Parameters)) -> Result<(), ProcessError> {
        let Some(parameters) = &mut self.parameters else { return Ok(()) };
        Ok(parameters.publish_by(|| self.clock.now_ns(), fill)?)
    }

    fn publish_event(&mut self, event: &Event) -> Result<(), ProcessError> {
        Ok(self.events.publish_by(|| self.clock.now_ns(), |message| *message = *event)?)
    }

    /// The supervisor carries the fault out. In lockstep, simulated time stands still until then, so that the fault
    /// strikes in this cycle.
    fn fault_is_due(&mut self, fault: usize) -> Result<(), ProcessError> {
        let report = Report::Due { fault, now_ns: self.clock.now_ns() };
        self.link.report(&report)?;
        match &self.clock {
            Clock::RealTime(_) => Ok(()),
            // The wait also ends with the supervisor.
            Clock::Lockstep(_) => Ok(self.link.next_order().map(drop)?),
        }
    }
}
