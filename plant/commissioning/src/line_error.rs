//! The reasons why a line to the drives cannot go on, and signs of other masters.

use std::fmt::{self, Display, Formatter};
use std::io;

use masseter_can::canopen::{AbortCode, ObjectAddress};
use masseter_can::{SendError, explain_errno};
use masseter_model::geometry::AXIS_NAMES;
use masseter_plant::{PlantError, sdo::SdoReason};

use crate::object_words::{object_name, value_text};

/// The reason for the end of a line.
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
    /// The drive acknowledges a value and shows another value, or none.
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
        /// The written value.
        written: u32,
        /// The value that the drive shows; none for a refusal to show the object.
        found: Option<u32>,
    },
    /// The request would switch on a second drive.
    #[error("{}: not switched on, because {} still is; end that step first", AXIS_NAMES[*axis], AXIS_NAMES[*other])]
    SecondAxis {
        /// The axis to be switched on.
        axis: usize,
        /// The axis that is switched on.
        other: usize,
    },
    /// The transmission of a frame fails.
    #[error("bus {bus}: {error}")]
    Send {
        /// The bus.
        bus: usize,
        /// The reason.
        error: SendError,
    },
    /// An interface fails: above all one that is unplugged, down, or has a full queue.
    #[error("bus {bus}, {interface}: {}", explain_errno(.interface, *.errno))]
    Interface {
        /// The bus.
        bus: usize,
        /// The interface.
        interface: String,
        /// Error number of the operating system.
        errno: i32,
    },
    /// The emulated mechanism failed, or the memory of emulated drives cannot be written.
    #[error(transparent)]
    Emulation(#[from] PlantError),
    /// The ledger cannot keep old values.
    #[error("old values of {} cannot be kept, so that no further value is written: {source}; free the disk", AXIS_NAMES[*axis])]
    Ledger {
        /// The axis.
        axis: usize,
        /// The reason.
        source: io::Error,
    },
    /// The write of the log fails.
    #[error("the log of the bus cannot be written: {0}")]
    Log(#[from] io::Error),
}

impl LineError {
    /// The abort code of a drive's refusal.
    pub fn abort_code(&self) -> Option<AbortCode> {
        match self {
            Self::Sdo { reason: SdoReason::Aborted(code), .. } => Some(*code),
            _ => None,
        }
    }
}

/// A drive that restarted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "{} restarted during the step; {} (values that are not stored are lost)",
    AXIS_NAMES[*axis], if *by_master { "end the other master, which sends NMT" } else { "check its supply" }
)]
pub struct Restarted {
    /// Its axis.
    pub axis: usize,
    /// Whether there is a sign of another master, which may have reset the drive.
    pub by_master: bool,
}

/// Frames that only another master sends, in the order of the list of signs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum MasterSign {
    /// Network management.
    Nmt,
    /// SDO requests to a drive.
    SdoRequests,
    /// SYNC.
    Sync,
    /// A heartbeat of the master's node id.
    Heartbeat,
    /// Process data for a drive.
    ProcessData,
}

impl Display for MasterSign {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Nmt => "NMT",
            Self::SdoRequests => "SDO requests",
            Self::Sync => "SYNC",
            Self::Heartbeat => "a heartbeat of node 127",
            Self::ProcessData => "process data",
        })
    }
}

/// Another master, which may control the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
#[error("bus {bus}: another master sends {sign}; end that program")]
pub struct OtherMaster {
    /// The bus.
    pub bus: usize,
    /// What it sends.
    pub sign: MasterSign,
}
