//! The order of a controller's cycle, for every clock.

use std::borrow::Borrow;

use super::{Controller, Tick};
use crate::messages::{Command, Event, Parameters, Reading, Signals, State};
use crate::named::{Change, NamedValues};
use crate::realtime::Wake;

/// The source and the destinations of a controller's messages, and the clock of its stamps.
pub trait ControllerPorts {
    /// A reading, owned or in shared memory.
    type Reading: Borrow<Reading>;
    /// Why a message could not be exchanged.
    type Error;

    /// Now, ns.
    fn now_ns(&self) -> u64;

    /// The reading of this cycle, or the newest reading when a longer wait would miss the deadline.
    ///
    /// # Errors
    /// When the messages cannot be received.
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
}

/// Runs one cycle: reading, decision, command; then state, signals, parameters and events, which no other loop waits for.
///
/// ```
/// use masseter_shared::control::{Controller, ControllerPorts, run_cycle};
/// use masseter_shared::named::NamedValues;
/// use masseter_shared::realtime::Wake;
///
/// /// A second at 1 kHz, in simulated time.
/// fn run_second<P: ControllerPorts>(
///     controller: &mut dyn Controller,
///     named: &mut NamedValues,
///     ports: &mut P,
/// ) -> Result<(), P::Error> {
///     for cycle in 1..=1000 {
///         run_cycle(controller, named, ports, &Wake::on_time(cycle, (cycle - 1) * 1_000_000 + 540_000))?;
///     }
///     Ok(())
/// }
/// ```
///
/// # Errors
/// Those of the ports.
pub fn run_cycle<P: ControllerPorts>(
    controller: &mut dyn Controller,
    named: &mut NamedValues,
    ports: &mut P,
    wake: &Wake,
) -> Result<(), P::Error> {
    let change = named.take_change();
    if let Some(change) = &change {
        controller.set_parameter(change.place, change.to);
    }
    let reading = ports.reading(wake)?;
    let received_ns = ports.now_ns();
    controller.observe(reading.as_ref().map(Borrow::borrow));
    let solved_ns = ports.now_ns();
    let event = controller.decide(Tick { cycle: wake.cycle, now_ns: solved_ns });
    let commanded_ns = ports.now_ns();
    ports.publish_command(|command| controller.fill_command(command))?;
    ports.publish_state(|state| {
        controller.fill_state(state);
        stamp(state, wake, [received_ns, solved_ns, commanded_ns]);
    })?;
    controller.fill_signals(named.signals_mut());
    publish_named(named, change, ports, Tick { cycle: wake.cycle, now_ns: commanded_ns })?;
    event.map_or(Ok(()), |event| ports.publish_event(&event))
}

/// Gives a controller the values of its parameters at the start.
pub fn set_parameters(controller: &mut dyn Controller, named: &NamedValues) {
    named.parameters().iter().enumerate().for_each(|(place, value)| controller.set_parameter(place, *value));
}

/// Publishes the signals of a cycle, and its change of a parameter.
pub(super) fn publish_named<P: ControllerPorts>(
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

/// Enters the cycle's times and the use of time into a state: when the reading was received, the pose was found, and the
/// command was ready.
pub(super) fn stamp(state: &mut State, wake: &Wake, [received_ns, solved_ns, commanded_ns]: [u64; 3]) {
    (state.due_ns, state.woke_ns) = (wake.due_ns, wake.woke_ns);
    (state.received_ns, state.solved_ns, state.commanded_ns) = (received_ns, solved_ns, commanded_ns);
    (state.skipped_cycles, state.stalled_ns) = (wake.skipped, wake.account.stalled_ns);
    (state.spun_ns, state.worked_ns) = (wake.account.spun_ns, wake.account.worked_ns);
    state.overlong_ns = wake.account.overlong_ns;
}
