//! Failures of domains and ports, and connections that iceoryx2 could not make.

use std::fmt::Debug;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::port::{DegradationAction, DegradationFn};

use crate::messages::{LAYOUT_VERSION, Message};

/// Why a domain could not be claimed or removed.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another run uses the name.
    #[error("a rig named '{id}' is running; wait for it, stop it, or give this one another --name")]
    InUse {
        /// The domain's id.
        id: String,
    },
    /// The id cannot be a file name.
    #[error("'{id}' cannot name a rig: use 1 to 32 letters, digits, '-' or '_'")]
    BadName {
        /// The id as given.
        id: String,
    },
    /// Another process claims or sweeps domains for longer than that takes.
    #[error("{holder} holds the lock {path} for more than 5 s; end it, or let it go on")]
    Busy {
        /// The lock.
        path: PathBuf,
        /// The process that holds it.
        holder: String,
    },
    /// Other users could read or replace the files of a run.
    #[error(
        "{path} is not a private folder of this user (mode 0700): remove it, or have root remove it, or set XDG_RUNTIME_DIR to a private folder{passed_over}"
    )]
    NotPrivate {
        /// The folder, or what has its name.
        path: PathBuf,
        /// Why the session's folder is of no use, if there is one.
        passed_over: String,
    },
    /// This process uses a file that is not this user's.
    #[error("another user has made {path}: start the rig again, whose files then have other names")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// This process uses a file that has been removed: nobody knows any more whose it was.
    #[error(
        "{path} was removed while the rig started, as when one of its processes is killed: start the rig again"
    )]
    Gone {
        /// The file.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("cannot {action} {path}: {error}")]
    File {
        /// What was tried.
        action: &'static str,
        /// Where.
        path: PathBuf,
        /// What the system said.
        error: io::Error,
    },
}

pub(super) fn file_error(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> DomainError {
    move |error| DomainError::File { action, path: path.to_owned(), error }
}

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
        "another user has made a file of this name in /dev/shm; start the rig again"
    } else if reason.contains("NotFound") {
        "no rig of this name runs"
    } else if reason.contains("Incompatible") {
        "a process of another version uses this topic; stop it"
    } else if reason.contains("ConnectionsRefused") {
        "/dev/shm is full, or too little memory may be locked ('masseter doctor'), or too few files opened ('ulimit -n')"
    } else {
        "'masseter clean' removes what killed runs left behind"
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
