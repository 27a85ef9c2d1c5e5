//! How a run came to its end, by how its processes ended. What that makes of the run, its verdict says.

use serde::{Deserialize, Serialize};

/// How a run came to its end.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Ending {
    /// The motion was played to its end.
    Completed,
    /// The controller stopped safely because of a fault.
    SafeStop,
    /// A process died.
    Died {
        /// Which.
        process: String,
        /// Exit code or signal.
        how: String,
    },
    /// The user interrupted it.
    Interrupted,
    /// Real time was required and refused.
    NotStarted,
    /// The recorder could not write everything.
    RecordingFailed,
}

impl Ending {
    /// The death of a process.
    pub fn died(process: &str, how: String) -> Self {
        Self::Died { process: process.to_owned(), how }
    }
}
