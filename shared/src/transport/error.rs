//! Failures of ports, and connections that iceoryx2 could not make.

use std::fmt::Debug;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, DegradationFn};

use crate::messages::{LAYOUT_VERSION, Message};

/// Why a port could not be made or used.
#[derive(Debug, thiserror::Error)]
#[error("iceoryx2: {action} failed ({reason}); {help}", help = help(reason))]
pub struct TransportError {
    action: String,
    reason: String,
}

/// What helps against the refusals users meet.
fn help(reason: &str) -> &'static str {
    if reason.contains("Permission") {
        "another user owns files of this name in /dev/shm"
    } else if reason.contains("Incompatible") {
        "a process of another version uses this topic; stop it"
    } else if reason.contains("ConnectionsRefused") {
        "/dev/shm is full, or too little memory may be locked (`masseter doctor`), or too few files opened (`ulimit -n`)"
    } else {
        "`masseter clean` removes what killed runs left behind"
    }
}

/// Formats the error only after a failure and outside of the hot path: the formatting code within the hot path made a
/// round trip a tenth slower.
pub(super) fn failed<E: Debug>(verb: &'static str, what: &str) -> impl FnOnce(E) -> TransportError {
    #[cold]
    fn error(verb: &str, what: &str, cause: &dyn Debug) -> TransportError {
        TransportError { action: format!("{verb} '{what}'"), reason: format!("{cause:?}") }
    }
    move |cause| error(verb, what, &cause)
}

/// Refuses a message that does not carry this program's version: a sender need not be this program.
pub(super) fn check_version<M: Message>(message: &M) -> Result<(), TransportError> {
    match message.version() {
        LAYOUT_VERSION => Ok(()),
        version => {
            let reason = format_args!("IncompatibleVersion({version}, this program has {LAYOUT_VERSION})");
            Err(failed("receiving", M::TOPIC)(reason))
        }
    }
}

/// Connections that a port could not make: iceoryx2 continues without them, and reports them in its log only.
#[derive(Debug, Clone, Default)]
pub(super) struct Refused(Arc<AtomicU32>);

impl Refused {
    /// For the port's builder.
    pub(super) fn counter(&self) -> impl DegradationFn + use<> {
        let Self(count) = self.clone();
        move |_, _| {
            count.fetch_add(1, Ordering::Relaxed);
            DegradationAction::Warn
        }
    }

    /// Makes a port's connections to the ports that are there by now.
    pub(super) fn connect(&self, port: &impl UpdateConnections, topic: &str) -> Result<(), TransportError> {
        port.update_connections().map_err(failed("connecting", topic))?;
        self.check(topic)
    }

    /// Refuses a port with missing connections: they leave no gap in any sequence, so a receiver must check.
    pub(super) fn check(&self, topic: &str) -> Result<(), TransportError> {
        match self.0.load(Ordering::Relaxed) {
            0 => Ok(()),
            count => Err(failed("connecting", topic)(format_args!("ConnectionsRefused({count})"))),
        }
    }
}
