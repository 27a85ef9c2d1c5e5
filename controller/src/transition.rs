//! The event that reports a change of state.

use masseter_shared::control::Tick;
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, ControllerState, EventKind, Source};

use crate::safety::Fault;
use crate::sequence::Trigger;

/// The event of a change from one state to another. A fault is reported with its cause, value and limit.
pub(crate) fn event(
    [from, to]: [ControllerState; 2],
    trigger: Trigger,
    fault: Option<Fault>,
    tick: Tick,
) -> Event {
    let is_stop = trigger == Trigger::StopRequested;
    let cause = if is_stop { Cause::StopRequested } else { Cause::Sequence };
    let mut event = Event {
        time_ns: tick.now_ns,
        cycle: tick.cycle,
        from: from.code(),
        to: to.code(),
        ..Event::new(Source::Controller, EventKind::Transition, cause)
    };
    if let Some(fault) = fault {
        event.kind = EventKind::Fault.code();
        fault.explain(&mut event);
    }
    event
}
