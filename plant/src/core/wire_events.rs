//! Events of the wires: changes of a CAN controller's error state, and beginning and end of injected faults.
//!
//! A real interface reports only its own controller. Single errors are no events; the log and the figures have them.

use masseter_can::faults::FaultNote;
use masseter_can::{ErrorKind, ErrorReport, ErrorState};
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

/// The highest error counter of an error active controller, and of an error passive one.
const ACTIVE_MAX: f64 = 127.0;
const PASSIVE_MAX: f64 = 255.0;

/// The event for a bus report that is a change of state; `axis` is the axis of its port.
pub(super) fn from_report(
    report: &ErrorReport,
    bus: usize,
    axis: Option<usize>,
    cycle: u64,
) -> Option<Event> {
    let ErrorKind::State(state) = report.kind else { return None };
    let (cause, limit) = match state {
        ErrorState::Active => (Cause::ErrorActive, ACTIVE_MAX),
        ErrorState::Passive => (Cause::ErrorPassive, ACTIVE_MAX),
        ErrorState::BusOff => (Cause::BusOff, PASSIVE_MAX),
    };
    let value = f64::from(report.tec);
    Some(Event { time_ns: report.time_ns, cycle, value, limit, ..notice(cause, bus, axis) })
}

/// The event for the beginning or the end of a fault on a bus; `axis` is the axis of the node concerned.
pub(super) fn from_note(note: &FaultNote, bus: usize, axis: Option<usize>, cycle: u64) -> Event {
    let cause = if note.has_ended { Cause::FaultEnded } else { Cause::FaultInjected };
    let (value, limit) = ((note.fault + 1) as f64, note.activations as f64);
    Event { time_ns: note.time_ns, cycle, value, limit, ..notice(cause, bus, axis) }
}

fn notice(cause: Cause, bus: usize, axis: Option<usize>) -> Event {
    let event = Event::new(Source::Wire, EventKind::Notice, cause);
    Event { axis: axis.map_or(event.axis, |axis| axis as u32), bus: bus as u16, ..event }
}
