//! A piece of food broke between the teeth, and the event that reports it.

use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, EventKind, Source};

/// A break.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoodBreak {
    /// FDI number of the first of the teeth on which the piece lay.
    pub tooth: u8,
    /// The piece's elastic force before, N.
    pub force_n: f64,
    /// Its strength, N.
    pub strength_n: f64,
}

impl FoodBreak {
    /// The event that reports it, at that time.
    pub(super) fn event(&self, time_ns: u64, cycle: u64) -> Event {
        let Self { tooth, force_n, strength_n } = *self;
        let event = Event::new(Source::Scenario, EventKind::Notice, Cause::FoodBroke);
        Event { time_ns, cycle, object: tooth.into(), value: force_n, limit: strength_n, ..event }
    }
}
