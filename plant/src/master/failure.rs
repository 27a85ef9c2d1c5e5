//! The reason of a stop or of a failed boot, with the values that explain the reason.

use masseter_can::canopen::ObjectAddress;
use masseter_runtime::messages::Event;
use masseter_runtime::messages::codes::{Cause, EventKind, Source};

/// A reason to stop the drives or to give up a boot, with the object, the value and the limit that explain the reason.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Failure {
    pub(super) cause: Cause,
    pub(super) object: Option<ObjectAddress>,
    pub(super) value: f64,
    pub(super) limit: f64,
}

impl Failure {
    /// A failure that needs no value to explain it.
    pub(super) const fn new(cause: Cause) -> Self {
        Self::with(cause, [0.0, 0.0])
    }

    /// A failure explained by a value and its limit.
    pub(super) const fn with(cause: Cause, [value, limit]: [f64; 2]) -> Self {
        Self { cause, object: None, value, limit }
    }

    /// The event that reports the failure.
    pub(super) fn event(&self) -> Event {
        self.event_of(EventKind::Fault)
    }

    /// The event that reports the same without a reaction.
    pub(super) fn notice(&self) -> Event {
        self.event_of(EventKind::Notice)
    }

    fn event_of(&self, kind: EventKind) -> Event {
        let Self { cause, object, value, limit } = *self;
        let object = object.map_or(0, |object| u32::from(object.index) << 8 | u32::from(object.subindex));
        Event { object, value, limit, ..Event::new(Source::Master, kind, cause) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_reported_with_its_object_value_and_limit() {
        let object = Some(ObjectAddress::new(0x1018, 0x02));
        let event = Failure { object, ..Failure::with(Cause::WrongIdentity, [7.0, 8.0]) }.event();
        assert_eq!((event.cause, event.object), (Cause::WrongIdentity.code(), 0x10_1802));
        assert_eq!((event.value, event.limit), (7.0, 8.0));
        assert_eq!((event.kind, event.source), (EventKind::Fault.code(), Source::Master.code()));
        assert_eq!(Failure::new(Cause::BusOff).event().object, 0);
    }
}
