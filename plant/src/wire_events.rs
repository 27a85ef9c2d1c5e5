//! What happens on simulated wires, and what faults do to the master's port of real ones, as events: controllers that change their error state, and the beginning
//! and end of injected faults. Single errors are no events; they are in the log and in the figures.

use masseter_shared::can::faults::FaultNote;
use masseter_shared::can::{ErrorKind, ErrorReport, ErrorState};
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, EventKind, NO_AXIS, Source};

/// The last error counter value of an error active, and of an error passive controller.
const ACTIVE_MAX: f64 = 127.0;
const PASSIVE_MAX: f64 = 255.0;

/// The event for a report, if it is a change of state; `axis` is the axis of its port.
pub(crate) fn of_report(report: &ErrorReport, axis: Option<usize>, cycle: u64) -> Option<Event> {
    let ErrorKind::State(state) = report.kind else { return None };
    let (cause, limit) = match state {
        ErrorState::Active => (Cause::ErrorActive, ACTIVE_MAX),
        ErrorState::Passive => (Cause::ErrorPassive, ACTIVE_MAX),
        ErrorState::BusOff => (Cause::BusOff, PASSIVE_MAX),
    };
    Some(notice(report.time_ns, cycle, cause, axis, [f64::from(report.tec), limit]))
}

/// The event for the beginning or the end of a fault; `axis` is the axis of the node concerned.
pub(crate) fn of_note(note: &FaultNote, axis: Option<usize>, cycle: u64) -> Event {
    let cause = if note.has_ended { Cause::FaultEnded } else { Cause::FaultInjected };
    notice(note.time_ns, cycle, cause, axis, [(note.fault + 1) as f64, note.strikes as f64])
}

fn notice(time_ns: u64, cycle: u64, cause: Cause, axis: Option<usize>, [value, limit]: [f64; 2]) -> Event {
    Event {
        time_ns,
        cycle,
        source: Source::Wire.code(),
        kind: EventKind::Notice.code(),
        cause: cause.code(),
        axis: axis.map_or(NO_AXIS, |axis| axis as u32),
        value,
        limit,
        ..Event::default()
    }
}
