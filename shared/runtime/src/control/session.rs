//! A controller's part in a run, on its [ports](super::ports), in real time or lockstep. This module decides nothing.

use std::time::Duration;

use masseter_scenario::input::sentence;

use super::ports::Ports;
use super::{
    Controller, ControllerPorts, Duties, Outcome, Tick, complete_state, publish_begin, publish_named,
    run_cycle, set_parameters,
};
use crate::lifecycle::{End, ProcessContext, ProcessError};
use crate::messages::codes::{Cause, EventKind, Source};
use crate::messages::{Command, Event, Reading, State};
use crate::named::{Declared, NamedValues, access};
use crate::{injection::Operator, realtime::Wake};

/// A started run, for its controller.
///
/// [`Self::run`] runs a [`Controller`] to its end. Or a program runs the cycles itself: [`Self::wait`],
/// [`Self::publish`], and at last [`Self::finish`] or [`Self::fail`]. A cycle begins with [`Self::wait`] and ends with
/// the next [`Self::wait`]. [`Self::publish`] refuses a command outside a cycle.
///
/// ```no_run
/// use masseter_runtime::control::{Outcome, Session, Waited};
/// use masseter_runtime::lifecycle::attach::attach;
/// use masseter_runtime::messages::codes::DriveRequest;
/// use masseter_runtime::messages::{Command, State};
/// use masseter_runtime::named::Declared;
///
/// let mut session = Session::start(attach(None)?, Declared::default())?;
/// while !session.is_stop_requested() {
///     let Waited::Cycle { tick, reading } = session.wait(None)? else { continue };
///     let reading_cycle = reading.map_or(0, |reading| reading.cycle);
///     let request = DriveRequest::Off.code();
///     let command = Command { cycle: tick.cycle, reading_cycle, request, ..Command::default() };
///     session.publish(&command, &State { cycle: tick.cycle, reading_cycle, ..State::default() })?;
/// }
/// session.finish(Outcome::Finished)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Session {
    context: ProcessContext,
    ports: Ports,
    duties: Duties,
    /// Whether the scenario's operator has asked for a stop.
    is_stopped: bool,
    stop_event: StopEvent,
    /// The cycle with an open turn.
    cycle: Option<OpenCycle>,
}

/// The event of a requested stop. A cycle that sees the request ends with it, so that a program cannot forget it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum StopEvent {
    /// No cycle has seen a request.
    None,
    /// The begun cycle is the first one with a request.
    Due,
    /// The session or the program has published it.
    Published,
}

/// A begun cycle.
#[derive(Debug, Clone, Copy)]
struct OpenCycle {
    wake: Wake,
    received_ns: u64,
    is_published: bool,
}

/// The result of a wait.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "it lives for a moment")]
pub enum Waited {
    /// A cycle has begun.
    Cycle {
        /// Its number and time.
        tick: Tick,
        /// The newest reading; none without a new reading in time.
        reading: Option<Reading>,
    },
    /// No cycle has begun within the given time.
    TimedOut,
}

/// The reason for an unpublished message.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// A message before the first cycle.
    #[error("no cycle has begun: call wait first")]
    NoCycle,
    /// A second command.
    #[error("cycle {0} has its command already: call wait for the next cycle")]
    Published(u64),
    /// A command of an earlier cycle, or of none: its sender may have stopped.
    #[error("the command is of cycle {given}, but cycle {cycle} has begun: make a command for each cycle")]
    OtherCycle {
        /// The cycle of the command.
        given: u64,
        /// The begun cycle.
        cycle: u64,
    },
    /// The transport or the supervisor.
    #[error(transparent)]
    Process(#[from] ProcessError),
}

impl Session {
    /// Opens the ports, reports ready, and waits for the start of the run. The signals and parameters are those of the
    /// controller. The scenario may give the parameters other values.
    ///
    /// # Errors
    /// [`ProcessError`] when the ports cannot be opened, the start is cancelled, or the declaration does not fit the
    /// scenario.
    pub fn start(context: ProcessContext, declared: Declared) -> Result<Self, ProcessError> {
        let named = NamedValues::new(declared, &context.scenario.parameters)?;
        if !named.parameters().is_empty() {
            access::serve(context.node.domain(), named.settings().clone())
                .map_err(ProcessError::Parameters)?;
        }
        let declared = named.settings().declared();
        // A check before the start refuses an impossible stimulus in time.
        Operator::new(&context.scenario, declared, 0)?;
        let (ports, epoch_ns) = Ports::open(&context, declared)?;
        let operator = Operator::new(&context.scenario, declared, epoch_ns)?;
        let duties = Duties { named, operator };
        Ok(Self { context, ports, duties, is_stopped: false, stop_event: StopEvent::None, cycle: None })
    }

    /// Runs the controller of the declaration to its end.
    ///
    /// # Errors
    /// [`ProcessError`] when messages cannot be exchanged.
    pub fn run(mut self, controller: &mut dyn Controller) -> Result<Outcome, ProcessError> {
        set_parameters(controller, &self.duties.named);
        loop {
            if let Some(outcome) = controller.outcome() {
                self.end(outcome)?;
                return Ok(outcome);
            }
            if self.is_stop_requested() {
                controller.request_stop();
            }
            self.end_turn(false)?;
            let wake = self.ports.begin_cycle(|| controller.warm_up())?;
            run_cycle(controller, &mut self.duties, &mut self.ports, &wake)?;
            self.cycle = Some(OpenCycle { wake, received_ns: 0, is_published: true });
        }
    }

    /// Whether an orderly end is requested. The program then brings the motion to rest, switches the drives off, and
    /// calls [`Self::finish`]. The session publishes the event, unless the program does in the same cycle.
    pub fn is_stop_requested(&self) -> bool {
        self.is_stopped || self.context.stop.is_made()
    }

    /// The context of the run, with its scenario and time table.
    pub fn context(&self) -> &ProcessContext {
        &self.context
    }

    /// Ends the current cycle and waits for the next. A time-out of zero only looks for the next cycle.
    ///
    /// # Errors
    /// [`ProcessError`] when messages cannot be exchanged.
    pub fn wait(&mut self, timeout: Option<Duration>) -> Result<Waited, ProcessError> {
        if self.stop_event == StopEvent::Due {
            self.publish_stop()?;
        }
        self.end_turn(false)?;
        if let Some(timeout) = timeout
            && !self.ports.begins_within(timeout)?
        {
            return Ok(Waited::TimedOut);
        }
        let wake = self.ports.begin_cycle(|| ())?;
        let reading = self.ports.reading(&wake)?.map(|reading| *reading);
        let received_ns = self.ports.now_ns();
        let tick = Tick { cycle: wake.cycle, now_ns: received_ns };
        self.act(reading.map(|reading| reading.sampled_ns), tick)?;
        self.cycle = Some(OpenCycle { wake, received_ns, is_published: false });
        if self.stop_event == StopEvent::None && self.is_stop_requested() {
            self.stop_event = StopEvent::Due;
        }
        Ok(Waited::Cycle { tick, reading })
    }

    /// Carries out due stimuli, and takes over a changed parameter.
    fn act(&mut self, sampled_ns: Option<u64>, tick: Tick) -> Result<(), ProcessError> {
        let stop = || self.is_stopped = true;
        let due = self.duties.carry_out_due(sampled_ns, &mut self.ports, stop)?;
        if let Some(change) = self.duties.named.take_change() {
            self.ports.publish_event(&change.event(tick.cycle, tick.now_ns))?;
        }
        publish_begin(due, &mut self.ports, tick)
    }

    /// The parameters in force in this cycle, in the order of their declaration.
    pub fn parameters(&self) -> &[f64] {
        self.duties.named.parameters()
    }

    /// The signals for this cycle's command, in the order of their declaration.
    pub fn signals_mut(&mut self) -> &mut [f64] {
        self.duties.named.signals_mut()
    }

    /// Publishes this cycle's command and state. The session enters the time stamps and the use of time into the state.
    ///
    /// # Errors
    /// [`SessionError`] for a second command in one cycle, a command of another cycle, a call before the first cycle,
    /// or a failed transmission.
    pub fn publish(&mut self, command: &Command, state: &State) -> Result<(), SessionError> {
        let OpenCycle { wake, received_ns, is_published } = self.cycle.ok_or(SessionError::NoCycle)?;
        if is_published {
            return Err(SessionError::Published(wake.cycle));
        }
        if command.cycle != wake.cycle {
            return Err(SessionError::OtherCycle { given: command.cycle, cycle: wake.cycle });
        }
        let commanded_ns = self.ports.now_ns();
        self.ports.publish_command(|message| *message = *command)?;
        self.ports.publish_state(|message| {
            *message = *state;
            self.duties.operator.note_state(state.controller_state);
            complete_state(message, &wake, [received_ns, commanded_ns, commanded_ns]);
        })?;
        let tick = Tick { cycle: wake.cycle, now_ns: commanded_ns };
        publish_named(&mut self.duties.named, None, &mut self.ports, tick)?;
        self.cycle = Some(OpenCycle { wake, received_ns, is_published: true });
        Ok(())
    }

    /// Publishes an event.
    ///
    /// # Errors
    /// [`ProcessError`] for a failed transmission.
    pub fn publish_event(&mut self, event: &Event) -> Result<(), ProcessError> {
        if event.cause == Cause::StopRequested.code() {
            self.stop_event = StopEvent::Published;
        }
        self.ports.publish_event(event)
    }

    fn publish_stop(&mut self) -> Result<(), ProcessError> {
        let cycle = self.cycle.map_or(0, |open| open.wake.cycle);
        let event = Event::new(Source::Controller, EventKind::Notice, Cause::StopRequested);
        self.publish_event(&Event { time_ns: self.ports.now_ns(), cycle, ..event })
    }

    /// Ends the work in order.
    ///
    /// # Errors
    /// [`ProcessError`] when the supervisor is gone.
    pub fn finish(mut self, outcome: Outcome) -> Result<(), ProcessError> {
        if self.stop_event != StopEvent::Published && self.is_stop_requested() {
            self.publish_stop()?;
        }
        self.end(outcome)
    }

    fn end(mut self, outcome: Outcome) -> Result<(), ProcessError> {
        self.end_turn(true)?;
        Ok(self.context.link.end(match outcome {
            Outcome::Finished => End::Finished,
            Outcome::SafeStop => End::SafeStop,
        })?)
    }

    /// Ends the work of a program that cannot go on. The plant's master stops the drives, because no command follows.
    ///
    /// # Errors
    /// [`ProcessError`] when the supervisor is gone.
    pub fn fail(mut self, reason: &str) -> Result<(), ProcessError> {
        // The reason first: the end of the turn fails when the plant has failed too.
        self.context.link.end(End::Failed { reason: sentence(reason) })?;
        self.end_turn(true)
    }

    /// Ends the turn of a begun cycle, in lockstep.
    fn end_turn(&mut self, is_last: bool) -> Result<(), ProcessError> {
        if self.cycle.take().is_some() || is_last {
            self.ports.end_turn(is_last)?;
        }
        Ok(())
    }
}
