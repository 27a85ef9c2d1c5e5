//! The settings of an emulated drive, from the scenario.

use masseter_can::canopen::NodeId;
use masseter_model::geometry::AXES;
use masseter_scenario::{DriveConfig, DriveProfile, MASTER_NODE, Scenario};

use super::axis::configure;
use super::dictionary::{Objects, names};
use super::memory::DriveMemory;
use super::quirks::Quirks;
use crate::checks::check_quantities;
use crate::error::PlantError;
use crate::link::layout::node_ids;

/// Settings of a drive.
#[derive(Debug, Clone)]
pub(crate) struct DriveSettings {
    /// Its node id.
    pub(crate) node: NodeId,
    /// The drive.
    pub(crate) drive: DriveConfig,
    /// Step of the servo loops, s.
    pub(crate) step_s: f64,
    /// The object dictionary as delivered.
    pub(crate) objects: Objects,
    /// What the drive has stored.
    pub(crate) memory: DriveMemory,
    /// What it does otherwise than the standard.
    pub(crate) quirks: Quirks,
    /// The ends of the axis' stroke, m.
    pub(crate) stroke_m: [f64; 2],
}

impl DriveSettings {
    /// The settings of a scenario's drives, in the order of the axes.
    ///
    /// # Errors
    /// [`PlantError`] for quantities that contradict each other and for node ids that cannot be used.
    pub(crate) fn for_axes(scenario: &Scenario) -> Result<[Self; AXES], PlantError> {
        check_quantities(scenario)?;
        let ids = node_ids(&scenario.can)?;
        let watched = u32::from(MASTER_NODE.get()) << 16 | u32::from(scenario.can.heartbeat_consumer_ms);
        let of_axis = |axis| scenario.drives.quirk.iter().filter(move |quirk| quirk.is_on(axis));
        let quirks =
            (0..AXES).map(|axis| Quirks::new(of_axis(axis))).collect::<Result<Vec<_>, PlantError>>()?;
        Ok(std::array::from_fn(|axis| {
            let (node, drive) = (ids[axis], scenario.drives.of_axis(axis));
            let stroke_m = scenario.mechanism.strokes.of_axis(axis);
            let position_limits = stroke_m.map(|end_m| drive.increments(end_m) as i32);
            let mut objects = Objects::new(node);
            let DriveProfile { identity, pdos, .. } = scenario.profile(axis);
            objects.set_mapping(0x1600, pdos.rpdo1().entries());
            objects.set_mapping(0x1A00, pdos.tpdo1().entries());
            objects.set(names::DEVICE_TYPE, identity.device_type);
            objects.set(names::VENDOR_ID, identity.vendor_id);
            objects.set(names::PRODUCT_CODE, identity.product_code);
            objects.set(names::REVISION, identity.revision);
            objects.set(names::CONSUMER_HEARTBEAT_TIME, watched);
            objects.set(names::PRODUCER_HEARTBEAT_TIME_MS, scenario.can.heartbeat_producer_ms);
            let mut quirks = quirks[axis].clone();
            quirks.set_units(&mut objects);
            configure(&mut objects, &drive, scenario.period_ns(), position_limits);
            quirks.set_values(scenario.period_ns(), &mut objects);
            let (step_s, memory) = (scenario.dynamics.step_ns as f64 * 1e-9, DriveMemory::default());
            Self { node, drive, step_s, objects, memory, quirks, stroke_m }
        }))
    }
}
