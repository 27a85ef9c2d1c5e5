//! Why a plant cannot be built or cannot go on.

use masseter_can::NotByPort;
use masseter_can::canopen::{NodeId, NodeIdError};
use masseter_can::{BitrateError, OpenError};
use masseter_shared::geometry::{AXIS_NAMES, GeometryError, LimitViolation};

use crate::dynamics::DynamicsError;

/// A plant that cannot be built or cannot go on.
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
    /// Two nodes of one id.
    #[error(
        "can.node_ids: node {id} stands twice, or is the master's ({}); give every drive its own",
        NodeId::MASTER
    )]
    SharedNodeId {
        /// The id.
        id: u8,
    },
    /// An axis on no bus, on two, or of no such number.
    #[error("can.buses: axis {axis} is named {times} times; name each of the axes 0 to 5 ({axes}) once", axes = AXIS_NAMES.join(" "))]
    Axis {
        /// The axis.
        axis: usize,
        /// How often it is named.
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
    /// A fault of a node that is not there.
    #[error("faults.node = {node}: bus {bus} has the nodes {present}")]
    FaultNode {
        /// The node named.
        node: u8,
        /// The bus named.
        bus: usize,
        /// Who is on it.
        present: String,
    },
    /// A fault that needs a simulated wire.
    #[error("faults: {0}")]
    NotByPort(#[from] NotByPort),
    /// A quantity that does not go with the others.
    #[error("{key} = {value}: {need}")]
    Quantity {
        /// The key.
        key: &'static str,
        /// What stands there.
        value: f64,
        /// What may stand there.
        need: &'static str,
    },
    /// Legs on which the platform cannot stand level within the strokes.
    #[error(
        "dynamics.initial_leg_m = {initial_leg_m}: {violation}; the rig must be switched on level within its strokes"
    )]
    Start {
        /// Length of the legs, m.
        initial_leg_m: f64,
        /// What is outside.
        violation: LimitViolation,
    },
    /// Drives that cannot boot in time.
    #[error(
        "controller.start_timeout_s = {start_timeout_s}: at {rate_hz} Hz the drives take {least_s:.1} s to boot, since a bus \
         carries one SDO request a cycle; use more, or a higher rate_hz"
    )]
    BootTime {
        /// How long they may take, s.
        start_timeout_s: f64,
        /// Cycles per second.
        rate_hz: u32,
        /// How long they take at least, s.
        least_s: f64,
    },
}
