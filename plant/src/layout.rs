//! Who the axes are on the buses: where each hangs and which node it is, as a scenario declares it.

use masseter_can::canopen::NodeId;
use masseter_shared::config::CanConfig;
use masseter_shared::geometry::AXES;

use crate::error::PlantError;
use crate::link::Place;

/// Where each axis hangs; port 0 of a bus is the master's.
pub(crate) fn places(can: &CanConfig) -> Result<[Place; AXES], PlantError> {
    let named = || can.buses.iter().flatten().copied();
    if let Some(axis) = named().find(|&axis| axis >= AXES) {
        return Err(PlantError::Axis { axis, times: named().filter(|&other| other == axis).count() });
    }
    if let Some(bus) = can.buses.iter().position(Vec::is_empty) {
        return Err(PlantError::EmptyBus { bus });
    }
    let mut places = [Place { bus: 0, port: 0 }; AXES];
    for (axis, place) in places.iter_mut().enumerate() {
        let times = named().filter(|&other| other == axis).count();
        if times != 1 {
            return Err(PlantError::Axis { axis, times });
        }
        for (bus, axes) in can.buses.iter().enumerate() {
            if let Some(index) = axes.iter().position(|&other| other == axis) {
                *place = Place { bus, port: index + 1 };
            }
        }
    }
    Ok(places)
}

/// The node of each axis.
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

/// The interface of each axis' bus.
pub(crate) fn interfaces_of_axes(can: &CanConfig) -> Result<[&str; AXES], PlantError> {
    Ok(places(can)?.map(|place| can.interfaces[place.bus].as_str()))
}
