//! The settings of an emulated drive, from the scenario, and the object dictionary that follows from them.

use masseter_can::canopen::NodeId;
use masseter_shared::config::{DriveConfig, Scenario};
use masseter_shared::geometry::AXES;

use super::axis::configure;
use super::dictionary::{Objects, names};
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
    /// Producer heartbeat time (1017h), ms.
    pub(crate) heartbeat_ms: u16,
    /// Consumer heartbeat time of the master (1016h), ms.
    pub(crate) heartbeat_timeout_ms: u16,
    /// Communication cycle (60C2h), ns.
    pub(crate) period_ns: u64,
    /// Step of the servo loops, s.
    pub(crate) step_s: f64,
    /// Min and max software position limit (607Dh), increments.
    pub(crate) position_limits: [i32; 2],
}

impl DriveSettings {
    /// The settings of a scenario's drives, in the order of the axes.
    ///
    /// # Errors
    /// [`PlantError`] for quantities that contradict each other and for node ids that cannot be used.
    pub(crate) fn for_axes(scenario: &Scenario) -> Result<[Self; AXES], PlantError> {
        check_quantities(scenario)?;
        let ids = node_ids(&scenario.can)?;
        Ok(std::array::from_fn(|axis| {
            let drive = scenario.drives.of_axis(axis);
            let stroke_m = scenario.mechanism.strokes.of_axis(axis);
            Self {
                node: ids[axis],
                drive,
                heartbeat_ms: scenario.can.heartbeat_producer_ms,
                heartbeat_timeout_ms: scenario.can.heartbeat_consumer_ms,
                period_ns: scenario.period_ns(),
                step_s: scenario.dynamics.step_ns as f64 * 1e-9,
                position_limits: stroke_m.map(|end_m| drive.increments(end_m) as i32),
            }
        }))
    }

    /// The object dictionary after power-on.
    pub(crate) fn objects(&self) -> Objects {
        let mut objects = Objects::new(self.node);
        let consumed = u32::from(NodeId::MASTER.get()) << 16 | u32::from(self.heartbeat_timeout_ms);
        objects.set(names::CONSUMER_HEARTBEAT_TIME, consumed);
        objects.set(names::PRODUCER_HEARTBEAT_TIME_MS, self.heartbeat_ms);
        configure(&mut objects, &self.drive, self.period_ns, self.position_limits);
        objects
    }
}
