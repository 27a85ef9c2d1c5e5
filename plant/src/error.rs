//! Errors of the plant: every reason why it cannot be built or cannot continue.

use std::path::PathBuf;

use masseter_can::NotByPort;
use masseter_can::canopen::NodeIdError;
use masseter_can::{BitrateError, OpenError};
use masseter_model::geometry::GeometryError;

use crate::mechanism::DynamicsError;

/// A plant that cannot be built or cannot continue.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The mechanism's dynamics.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// A real interface.
    #[error(transparent)]
    Interface(#[from] OpenError),
    /// Another master of this machine drives the interface.
    #[error("{0}: another rig drives it; end that one, or use other interfaces")]
    MasterHere(String),
    /// The bit rate.
    #[error("can.bitrate_bps: {0}")]
    Bitrate(#[from] BitrateError),
    /// A node id out of range.
    #[error("can.node_ids: {0}")]
    NodeId(#[from] NodeIdError),
    /// A fault that needs a simulated wire.
    #[error("faults: {0}")]
    NotByPort(#[from] NotByPort),
    /// A table of a stimulus.
    #[error("{}{}: {problem}", path.display(), line.map(|line| format!(":{line}")).unwrap_or_default())]
    Table {
        /// The file.
        path: PathBuf,
        /// The line, from 1; none where the file as a whole is at fault.
        line: Option<u64>,
        /// What is wrong, with its remedy.
        problem: String,
    },
    /// The file with the drives' memory.
    #[error("drives.memory = {}: {reason}; mend the file, or remove it for drives that have stored nothing", path.display())]
    Memory {
        /// The file.
        path: PathBuf,
        /// Why it cannot be used.
        reason: String,
    },
    /// Values of the scenario that cannot be used together: their keys, the reason and the remedy.
    #[error("{0}")]
    Scenario(String),
}
