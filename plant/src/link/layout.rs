//! The axes on the buses: port and node id of each, as a scenario declares them.

use masseter_can::canopen::NodeId;
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_scenario::{CanConfig, MASTER_NODE};

use crate::error::PlantError;

/// The master's port on every wire.
pub(crate) const MASTER_PORT: usize = 0;

/// The port of an axis' drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct DrivePort {
    pub(crate) bus: usize,
    pub(crate) port: usize,
}

/// The port of each axis' drive; those of a bus follow [`MASTER_PORT`].
pub(crate) fn drive_ports(can: &CanConfig) -> Result<[DrivePort; AXES], PlantError> {
    if let Some(bus) = can.buses.iter().position(Vec::is_empty) {
        return Err(PlantError::Scenario(format!(
            "can.buses: bus {bus} has no drive, so no node would acknowledge the master's frames; remove this bus"
        )));
    }
    let named = || can.buses.iter().flatten().copied();
    let times = |axis: usize| named().filter(|&other| other == axis).count();
    let unknown = named().find(|&axis| axis >= AXES);
    if let Some(axis) = unknown.or_else(|| (0..AXES).find(|&axis| times(axis) != 1)) {
        let (times, names) = (times(axis), AXIS_NAMES.join(" "));
        return Err(PlantError::Scenario(format!(
            "can.buses: axis {axis} is named {times} times; name each of the axes 0 to 5 ({names}) once"
        )));
    }
    let mut ports = [DrivePort { bus: 0, port: MASTER_PORT }; AXES];
    for (bus, axes) in can.buses.iter().enumerate() {
        for (index, &axis) in axes.iter().enumerate() {
            ports[axis] = DrivePort { bus, port: MASTER_PORT + 1 + index };
        }
    }
    Ok(ports)
}

/// The node id of each axis' drive.
pub(crate) fn node_ids(can: &CanConfig) -> Result<[NodeId; AXES], PlantError> {
    let mut ids = [MASTER_NODE; AXES];
    for (axis, &id) in can.node_ids.iter().enumerate() {
        let is_taken = id == MASTER_NODE.get() || can.node_ids[..axis].contains(&id);
        if is_taken {
            let reason = format!("node {id} is listed twice, or is the master's ({MASTER_NODE})");
            return Err(PlantError::Scenario(format!("can.node_ids: {reason}; give every drive its own")));
        }
        ids[axis] = NodeId::new(id)?;
    }
    Ok(ids)
}
