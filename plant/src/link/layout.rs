//! The axes on the buses: port and node id of each, as a scenario declares them.

use masseter_can::canopen::NodeId;
use masseter_shared::config::CanConfig;
use masseter_shared::geometry::AXES;

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
    let named = || can.buses.iter().flatten().copied();
    if let Some(axis) = named().find(|&axis| axis >= AXES) {
        return Err(PlantError::Axis { axis, times: named().filter(|&other| other == axis).count() });
    }
    if let Some(bus) = can.buses.iter().position(Vec::is_empty) {
        return Err(PlantError::EmptyBus { bus });
    }
    let mut ports = [DrivePort { bus: 0, port: MASTER_PORT }; AXES];
    for (axis, drive_port) in ports.iter_mut().enumerate() {
        let times = named().filter(|&other| other == axis).count();
        if times != 1 {
            return Err(PlantError::Axis { axis, times });
        }
        for (bus, axes) in can.buses.iter().enumerate() {
            if let Some(index) = axes.iter().position(|&other| other == axis) {
                *drive_port = DrivePort { bus, port: MASTER_PORT + 1 + index };
            }
        }
    }
    Ok(ports)
}

/// The node id of each axis' drive.
pub(crate) fn node_ids(can: &CanConfig) -> Result<[NodeId; AXES], PlantError> {
    let mut ids = [NodeId::MASTER; AXES];
    for (axis, &id) in can.node_ids.iter().enumerate() {
        let is_taken = id == NodeId::MASTER.get() || can.node_ids[..axis].contains(&id);
        if is_taken {
            return Err(PlantError::SharedNodeId { id });
        }
        ids[axis] = NodeId::new(id)?;
    }
    Ok(ids)
}
