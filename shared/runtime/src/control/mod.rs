//! The seam between the rig and a controller: the trait, the order of a cycle, and a controller's part in a run.
//!
//! A [`Controller`] is a pure step function. Only [`run_cycle`] orders a cycle, for every clock. [`Session::run`] calls it in
//! real time and in lockstep; the runner of virtual time calls it in one thread. Kinematics, trajectories and safety of a
//! particular controller are not here.

mod deadline;
mod ports;
mod session;

use std::borrow::Borrow;

use crate::injection::{Due, Injected, Operator, begin_event};
use crate::messages::{Command, Event, Parameters, Reading, Signals, State};
use crate::named::{Change, Declared, NamedValues};
use crate::realtime::Wake;

pub use deadline::Deadline;
pub use session::{Session, SessionError, Waited};

/// A cycle's place in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tick {
    /// Number of the cycle, from 1; skipped cycles leave a gap.
    pub cycle: u64,
    /// The time of the decision, ns.
    pub now_ns: u64,
}

/// How a controller ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The controller has completed its task, and the drives are off.
    Finished,
    /// A fault ended the motion.
    SafeStop,
}

/// A controller, or a pose law, whose state cannot be copied: it has no `branch`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{0} cannot be branched, since nobody but itself can copy its state; write its `branch`, or use a controller of the rig"
)]
pub struct NoBranch(pub &'static str);

impl NoBranch {
    /// The refusal for that type.
    pub fn of<T: ?Sized>() -> Self {
        Self(std::any::type_name::<T>())
    }
}

/// A controller of the robot. Time and messages come in as arguments; no method may block, allocate or do I/O.
///
/// Each cycle calls, in this order: [`observe`](Self::observe), [`decide`](Self::decide),
/// [`fill_command`](Self::fill_command), [`fill_state`](Self::fill_state). The rig adds the time stamps.
///
/// # Examples
/// A controller that leaves the drives without voltage for ten cycles:
///
/// ```
/// use masseter_runtime::control::{Controller, Outcome, Tick};
/// use masseter_runtime::messages::codes::{ControllerState, DriveRequest};
/// use masseter_runtime::messages::{Command, Event, Reading, State};
///
/// #[derive(Default)]
/// struct Idle {
///     cycle: u64,
///     reading_cycle: u64,
/// }
///
/// impl Controller for Idle {
///     fn observe(&mut self, reading: Option<&Reading>) {
///         self.reading_cycle = reading.map_or(self.reading_cycle, |reading| reading.cycle);
///     }
///
///     fn decide(&mut self, tick: Tick) -> Option<Event> {
///         self.cycle = tick.cycle;
///         None
///     }
///
///     fn fill_command(&self, command: &mut Command) {
///         let (cycle, reading_cycle) = (self.cycle, self.reading_cycle);
///         *command = Command { cycle, reading_cycle, request: DriveRequest::Off.code(), ..Command::default() };
///     }
///
///     fn fill_state(&mut self, state: &mut State) {
///         let controller_state = ControllerState::Finished.code();
///         *state = State { cycle: self.cycle, controller_state, ..State::default() };
///     }
///
///     fn request_stop(&mut self) {}
///
///     fn outcome(&self) -> Option<Outcome> {
///         (self.cycle >= 10).then_some(Outcome::Finished)
///     }
/// }
/// ```
#[doc(alias("control law", "regulator"))]
pub trait Controller {
    /// Takes the newest reading; none without a reading in time.
    fn observe(&mut self, reading: Option<&Reading>);

    /// Decides the command of the drives, and reports a change of state.
    fn decide(&mut self, tick: Tick) -> Option<Event>;

    /// Writes this cycle's command: targets in m, and a request to all drives.
    fn fill_command(&self, command: &mut Command);

    /// Writes the state of this cycle.
    fn fill_state(&mut self, state: &mut State);

    /// Asks for an orderly stop: the motion comes to rest, then the drives are switched off.
    fn request_stop(&mut self);

    /// The controller's outcome; none before its end.
    fn outcome(&self) -> Option<Outcome>;

    /// The signals that the controller publishes, and the parameters that its user sets. Called once, before the start.
    fn declared(&self) -> Declared {
        Declared::default()
    }

    /// Takes a parameter's value, within its range, before the first cycle or at the beginning of a cycle.
    fn set_parameter(&mut self, _place: usize, _value: f64) {}

    /// Writes the declared signals of this cycle.
    fn fill_signals(&self, _signals: &mut [f64]) {}

    /// Does work of the next cycle in advance and without effect, so that its code and data are in the caches.
    fn warm_up(&self) {}

    /// A copy of the controller with its whole state, for an independent continuation. Not part of a cycle.
    ///
    /// # Errors
    /// [`NoBranch`] for a controller without copies.
    fn branch(&self) -> Result<Box<dyn Controller>, NoBranch> {
        Err(NoBranch::of::<Self>())
    }
}

/// The source and the destinations of a controller's messages, and the clock of its stamps.
pub trait ControllerPorts {
    /// A reading, owned or in shared memory.
    type Reading: Borrow<Reading>;
    /// A failed exchange of a message.
    type Error;

    /// Now, ns.
    fn now_ns(&self) -> u64;

    /// The reading of this cycle, or the newest reading if a longer wait misses the deadline.
    ///
    /// # Errors
    /// When the reception of messages fails.
    fn reading(&mut self, wake: &Wake) -> Result<Option<Self::Reading>, Self::Error>;

    /// Publishes the command that `fill` writes.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_command(&mut self, fill: impl FnOnce(&mut Command)) -> Result<(), Self::Error>;

    /// Publishes the state that `fill` writes.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_state(&mut self, fill: impl FnOnce(&mut State)) -> Result<(), Self::Error>;

    /// Publishes the signals that `fill` writes.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_signals(&mut self, fill: impl FnOnce(&mut Signals)) -> Result<(), Self::Error>;

    /// Publishes the parameters that `fill` writes.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_parameters(&mut self, fill: impl FnOnce(&mut Parameters)) -> Result<(), Self::Error>;

    /// Publishes an event.
    ///
    /// # Errors
    /// When the message cannot be sent.
    fn publish_event(&mut self, event: &Event) -> Result<(), Self::Error>;

    /// Reports a due fault of a process, by its place in the scenario's list. No action without processes.
    ///
    /// # Errors
    /// When the supervisor is gone.
    fn fault_is_due(&mut self, _fault: usize) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// The values of a controller's named numbers in a run, and the operator of the scenario. A clone has settings of its
/// own.
#[derive(Debug, Clone)]
pub struct Duties {
    /// The signals and parameters.
    pub named: NamedValues,
    /// The operator, who sets parameters and asks for a stop.
    pub operator: Operator,
}

impl Duties {
    /// Carries out what is due in a cycle with a reading sampled at this time, ns.
    #[inline]
    fn carry_out_due<P: ControllerPorts>(
        &mut self,
        sampled_ns: Option<u64>,
        ports: &mut P,
        request_stop: impl FnOnce(),
    ) -> Result<Option<(Injected, Due)>, P::Error> {
        let due = self.operator.take_due(sampled_ns);
        match due {
            Some((_, Due::Set { place, value })) => self.named.settings().store(place, value),
            Some((_, Due::Stop)) => request_stop(),
            Some((_, Due::Fault(fault))) => ports.fault_is_due(fault)?,
            None => {}
        }
        Ok(due)
    }
}

/// What the first part of a cycle leaves to the second one.
#[derive(Debug, Clone, Copy)]
pub struct Observed {
    due: Option<(Injected, Due)>,
    change: Option<Change>,
    received_ns: u64,
    solved_ns: u64,
}

/// Runs one cycle: reading, decision, command; then state, signals, parameters and events. No other loop waits for the
/// latter.
///
/// ```
/// use masseter_runtime::control::{Controller, ControllerPorts, Duties, run_cycle};
/// use masseter_runtime::realtime::Wake;
///
/// /// A second at 1 kHz, in simulated time.
/// fn run_second<P: ControllerPorts>(
///     controller: &mut dyn Controller,
///     duties: &mut Duties,
///     ports: &mut P,
/// ) -> Result<(), P::Error> {
///     for cycle in 1..=1000 {
///         run_cycle(controller, duties, ports, &Wake::on_time(cycle, (cycle - 1) * 1_000_000 + 540_000))?;
///     }
///     Ok(())
/// }
/// ```
///
/// # Errors
/// Those of the ports.
pub fn run_cycle<P: ControllerPorts>(
    controller: &mut dyn Controller,
    duties: &mut Duties,
    ports: &mut P,
    wake: &Wake,
) -> Result<(), P::Error> {
    let observed = observe(controller, duties, ports, wake)?;
    decide(controller, duties, ports, wake, observed)
}

/// The first part of [`run_cycle`]: what is due, and the reading.
///
/// # Errors
/// Those of the ports.
#[inline]
pub fn observe<P: ControllerPorts>(
    controller: &mut dyn Controller,
    duties: &mut Duties,
    ports: &mut P,
    wake: &Wake,
) -> Result<Observed, P::Error> {
    let reading = ports.reading(wake)?;
    let received_ns = ports.now_ns();
    let sampled_ns = reading.as_ref().map(|reading| reading.borrow().sampled_ns);
    let due = duties.carry_out_due(sampled_ns, ports, || controller.request_stop())?;
    let change = duties.named.take_change();
    if let Some(change) = &change {
        controller.set_parameter(change.place, change.to);
    }
    controller.observe(reading.as_ref().map(Borrow::borrow));
    let solved_ns = ports.now_ns();
    Ok(Observed { due, change, received_ns, solved_ns })
}

/// The second part of [`run_cycle`]: the decision, and every message.
///
/// # Errors
/// Those of the ports.
#[inline]
pub fn decide<P: ControllerPorts>(
    controller: &mut dyn Controller,
    Duties { named, operator }: &mut Duties,
    ports: &mut P,
    wake: &Wake,
    Observed { due, change, received_ns, solved_ns }: Observed,
) -> Result<(), P::Error> {
    let event = controller.decide(Tick { cycle: wake.cycle, now_ns: solved_ns });
    let commanded_ns = ports.now_ns();
    ports.publish_command(|command| controller.fill_command(command))?;
    ports.publish_state(|state| {
        controller.fill_state(state);
        operator.note_state(state.controller_state);
        complete_state(state, wake, [received_ns, solved_ns, commanded_ns]);
    })?;
    controller.fill_signals(named.signals_mut());
    let tick = Tick { cycle: wake.cycle, now_ns: commanded_ns };
    publish_named(named, change, ports, tick)?;
    publish_begin(due, ports, tick)?;
    event.map_or(Ok(()), |event| ports.publish_event(&event))
}

/// Gives a controller the values of its parameters at the start.
pub fn set_parameters(controller: &mut dyn Controller, named: &NamedValues) {
    named.parameters().iter().enumerate().for_each(|(place, value)| controller.set_parameter(place, *value));
}

/// Publishes the signals of a cycle, and its change of a parameter.
fn publish_named<P: ControllerPorts>(
    named: &mut NamedValues,
    change: Option<Change>,
    ports: &mut P,
    Tick { cycle, now_ns }: Tick,
) -> Result<(), P::Error> {
    if let Some(signals) = named.signals() {
        ports.publish_signals(|message| *message = Signals { cycle, signals, ..Signals::default() })?;
    }
    if let Some(parameters) = named.take_changed_parameters() {
        ports.publish_parameters(|message| {
            *message = Parameters { cycle, parameters, ..Parameters::default() }
        })?;
    }
    change.map_or(Ok(()), |change| ports.publish_event(&change.event(cycle, now_ns)))
}

/// Reports a stimulus that began in a cycle.
fn publish_begin<P: ControllerPorts>(
    due: Option<(Injected, Due)>,
    ports: &mut P,
    Tick { cycle, now_ns }: Tick,
) -> Result<(), P::Error> {
    let event = due.and_then(|(injected, _)| begin_event(injected, cycle, now_ns));
    event.map_or(Ok(()), |event| ports.publish_event(&event))
}

/// Completes a state for its publication: rounds its figures, and enters the use of time and the times of the cycle.
/// These are the times of the received reading, the found pose, and the ready command.
fn complete_state(state: &mut State, wake: &Wake, [received_ns, solved_ns, commanded_ns]: [u64; 3]) {
    (state.due_ns, state.woke_ns) = (wake.due_ns, wake.woke_ns);
    (state.received_ns, state.solved_ns, state.commanded_ns) = (received_ns, solved_ns, commanded_ns);
    (state.skipped_cycles, state.stalled_ns) = (wake.skipped, wake.account.stalled_ns);
    (state.spun_ns, state.worked_ns) = (wake.account.spun_ns, wake.account.worked_ns);
    state.overlong_ns = wake.account.overlong_ns;
    state.round();
}
