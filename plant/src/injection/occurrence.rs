//! The beginning or the end of a fault or a stimulus, and the event that reports it.

use masseter_runtime::injection::Injected;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

/// A fault or a stimulus began to act, or its time is over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Occurrence {
    /// Which.
    pub injected: Injected,
    /// When, ns.
    pub time_ns: u64,
    /// The axis concerned, if there is one.
    pub axis: Option<usize>,
    /// Whether it is over.
    pub has_ended: bool,
}

impl Occurrence {
    /// The event that reports it.
    pub(super) fn event(&self, cycle: u64) -> Event {
        let Self { injected, time_ns, axis, has_ended } = *self;
        let (place, cause) = match (injected, has_ended) {
            (Injected::Fault(place), false) => (place, Cause::FaultInjected),
            (Injected::Fault(place), true) => (place, Cause::FaultEnded),
            (Injected::Stimulus(place), false) => (place, Cause::StimulusBegan),
            (Injected::Stimulus(place), true) => (place, Cause::StimulusEnded),
        };
        let event = Event::new(Source::Scenario, EventKind::Notice, cause);
        let axis = axis.map_or(event.axis, |axis| axis as u32);
        Event { time_ns, cycle, axis, value: (place + 1) as f64, limit: 1.0, ..event }
    }
}
