//! Errors of the plant: every reason why it cannot be built or cannot continue.

use masseter_can::NotByPort;
use masseter_can::canopen::{NodeId, NodeIdError};
use masseter_can::{BitrateError, OpenError};
use masseter_shared::geometry::{AXIS_NAMES, GeometryError};

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
    #[error("{interface}: another rig drives it; end that one, or use other interfaces")]
    MasterHere {
        /// The interface.
        interface: String,
    },
    /// The bit rate.
    #[error("can.bitrate_bps: {0}")]
    Bitrate(#[from] BitrateError),
    /// A node id out of range.
    #[error("can.node_ids: {0}")]
    NodeId(#[from] NodeIdError),
    /// Two nodes with one id.
    #[error(
        "can.node_ids: node {id} stands twice, or is the master's ({}); give every drive its own",
        NodeId::MASTER
    )]
    SharedNodeId {
        /// The id.
        id: u8,
    },
    /// An axis on no bus or on two, or an unknown axis.
    #[error("can.buses: axis {axis} is named {times} times; name each of the axes 0 to 5 ({axes}) once", axes = AXIS_NAMES.join(" "))]
    Axis {
        /// The axis.
        axis: usize,
        /// The number of times it is named.
        times: usize,
    },
    /// A bus without a drive.
    #[error(
        "can.buses: bus {bus} has no drive, and nobody would acknowledge what the master sends; leave it away"
    )]
    EmptyBus {
        /// The bus.
        bus: usize,
    },
    /// A fault of a node that is not on its bus.
    #[error("faults.node = {node}: bus {bus} has the nodes {present}")]
    FaultNode {
        /// The node named.
        node: u8,
        /// The bus named.
        bus: usize,
        /// The nodes on it.
        present: String,
    },
    /// A fault that needs a simulated wire.
    #[error("faults: {0}")]
    NotByPort(#[from] NotByPort),
    /// A quantity that contradicts others.
    #[error("{key} = {value}: {need}")]
    Quantity {
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// The values allowed, and the remedy.
        need: &'static str,
    },
    /// Drives that cannot boot in time.
    #[error(
        "controller.start_timeout_s = {start_timeout_s}: at {rate_hz} Hz the drives take {least_s:.1} s to boot, since a bus \
         carries one SDO request a cycle; use more, or a higher rate_hz"
    )]
    BootTime {
        /// The time they may take, s.
        start_timeout_s: f64,
        /// Cycles per second.
        rate_hz: u32,
        /// The shortest time they take, s.
        least_s: f64,
    },
}
