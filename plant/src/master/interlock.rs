//! The interlock: whether the master refuses to move the drives, and for how long.
//!
//! Other parts find the reasons; the interlock remembers only the consequence.

use masseter_can::canopen::ObjectAddress;
use masseter_shared::messages::Event;
use masseter_shared::messages::codes::{Cause, EventKind, Source};

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
        let Self { cause, object, value, limit } = *self;
        let object = object.map_or(0, |object| u32::from(object.index) << 8 | u32::from(object.subindex));
        Event { object, value, limit, ..Event::new(Source::Master, EventKind::Fault, cause) }
    }
}

/// The interlock of the drives' motion.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Interlock {
    #[default]
    Released,
    /// Locked until every drive is verified again and the controller has switched them off.
    UntilRestored,
    Permanent,
}

impl Interlock {
    /// Whether drives may be booted. During a stop they may not: it needs every drive's attention. After a permanent
    /// lock nobody moves the drives again, and another master may control them.
    pub(super) fn may_boot(self, drives_are_off: bool) -> bool {
        match self {
            Self::Released => true,
            Self::UntilRestored => drives_are_off,
            Self::Permanent => false,
        }
    }

    /// Locks for a cause; returns whether this is the first cause. A later cause, which is mostly a consequence of the
    /// first, changes nothing.
    pub(super) fn lock(&mut self, cause: Cause) -> bool {
        let is_first = *self == Self::Released;
        if is_first {
            *self = match cause {
                Cause::CommandLost
                | Cause::BadMessage
                | Cause::StrokeLimit
                | Cause::VelocityLimit
                | Cause::AccelerationLimit
                | Cause::DriveFault
                | Cause::FollowingError => Self::Permanent,
                _ => Self::UntilRestored,
            };
        }
        is_first
    }
}
