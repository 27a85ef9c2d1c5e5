//! Why a line to the drives cannot go on.

use std::io;

use masseter_can::SendError;
use masseter_can::canopen::{AbortCode, ObjectAddress};
use masseter_model::geometry::AXIS_NAMES;

use super::wording::{object_name, value_text};
use crate::error::PlantError;

/// Why a question had no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SdoReason {
    /// The drive refused the transfer.
    #[error("{0}")]
    Aborted(AbortCode),
    /// Nothing came.
    #[error("no answer; check its power, wiring, bit rate and node id")]
    Silent,
    /// The answers do not follow the protocol, or never end.
    #[error("answers beside the protocol; check whether two nodes have this id")]
    Malformed,
}

/// Why an object could not be read.
pub fn reason_text(reason: SdoReason) -> String {
    match reason {
        SdoReason::Aborted(AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX) => "not there".to_owned(),
        reason => reason.to_string(),
    }
}

/// Why a line cannot go on.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// A transfer failed.
    #[error("{}: object {object}: {reason}", AXIS_NAMES[*axis])]
    Sdo {
        /// The axis.
        axis: usize,
        /// The object.
        object: ObjectAddress,
        /// The reason.
        reason: SdoReason,
    },
    /// The drive acknowledged a value and shows another one, or none.
    #[error(
        "{}: object {object} ({}) := {}: the drive acknowledged it and shows {}",
        AXIS_NAMES[*axis], object_name(*object), value_text(*object, *written),
        found.map_or_else(|| "nothing".to_owned(), |found| value_text(*object, found))
    )]
    NotKept {
        /// The axis.
        axis: usize,
        /// The object.
        object: ObjectAddress,
        /// The value that was written.
        written: u32,
        /// The value that the drive shows; none where it refuses to show the object.
        found: Option<u32>,
    },
    /// A second drive would be switched on.
    #[error("{}: not switched on, because {} still is; end that step first", AXIS_NAMES[*axis], AXIS_NAMES[*other])]
    SecondAxis {
        /// The axis to be switched on.
        axis: usize,
        /// The axis that is.
        other: usize,
    },
    /// A frame could not be sent.
    #[error("bus {bus}: {error}")]
    Send {
        /// The bus.
        bus: usize,
        /// The reason.
        error: SendError,
    },
    /// The emulated mechanism failed, or the memory of emulated drives cannot be written.
    #[error(transparent)]
    Emulation(#[from] PlantError),
    /// Old values could not be kept.
    #[error("old values of {} cannot be kept, so that no further value is written: {source}; free the disk", AXIS_NAMES[*axis])]
    Ledger {
        /// The axis.
        axis: usize,
        /// The reason.
        source: io::Error,
    },
    /// The log could not be written.
    #[error("the log of the bus cannot be written: {0}")]
    Log(#[from] io::Error),
}

impl LineError {
    /// The code with which a drive refused a transfer.
    pub fn abort_code(&self) -> Option<AbortCode> {
        match self {
            Self::Sdo { reason: SdoReason::Aborted(code), .. } => Some(*code),
            _ => None,
        }
    }
}
