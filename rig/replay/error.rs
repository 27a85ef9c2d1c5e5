//! Why a run cannot be replayed.

use masseter_recording::ReadError;
use masseter_scenario::wording::counted;

/// The reason, and what to do.
#[derive(Debug, thiserror::Error)]
pub(super) enum ReplayError {
    /// Another program controlled the robot.
    #[error(
        "the controller of this run was {}: only those of the rig (motion, hold) can be replayed; 'masseter diff' compares \
         two runs of any program",
        .0.as_deref().unwrap_or("another program")
    )]
    ForeignController(Option<String>),
    /// Messages of a topic are missing.
    #[error(
        "the recording lacks {} on '{topic}', so what the controller received is unknown: record the run again",
        counted(*.missing, "message")
    )]
    Gap {
        /// The topic.
        topic: &'static str,
        /// Their number.
        missing: u64,
    },
    /// A part of the file is missing or damaged.
    #[error("the recording is incomplete: 'masseter recording verify' says where; record the run again")]
    Incomplete,
    /// No cycle was recorded.
    #[error("the recording has no cycle of the controller: the run ended before its first")]
    NoCycle,
    /// A state names a reading that is not there.
    #[error("in cycle {cycle} the controller used reading {reading}, which the recording does not have")]
    NoReading {
        /// The cycle.
        cycle: u64,
        /// The cycle of the reading.
        reading: u64,
    },
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
}
