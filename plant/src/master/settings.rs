//! The settings of the master, from the scenario.

use masseter_can::canopen::{NodeId, sync};
use masseter_can::wire::{INTERFRAME_BITS, frame_bits};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;

use super::boot::DriveSetup;
use crate::error::PlantError;
use crate::link::layout::{drive_ports, node_ids};

/// Units of a drive's process data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    /// One increment of 607Ah and 6064h, m.
    pub(super) increment_m: f64,
    /// Force at 1000 ‰ of 6077h, N.
    pub(super) rated_force_n: f64,
}

/// A drive as the master expects it.
#[derive(Debug, Clone)]
pub(super) struct ExpectedDrive {
    /// Its node id.
    pub(super) id: NodeId,
    /// Its bus.
    pub(super) bus: usize,
    /// Units of its process data.
    pub(super) scale: Scale,
    /// Its identity and configuration.
    pub(super) setup: DriveSetup,
}

/// Settings of the master.
#[derive(Debug, Clone)]
pub(super) struct MasterSettings {
    /// Its own node id, for its heartbeat.
    pub(super) id: NodeId,
    /// The drives in the order of the axes.
    pub(super) drives: [ExpectedDrive; AXES],
    /// Number of buses.
    pub(super) buses: usize,
    /// From the first to the last bit of SYNC, at which the drives sample, ns.
    pub(super) sync_frame_ns: u64,
    /// Producer heartbeat time, ns.
    pub(super) heartbeat_ns: u64,
    /// Consumer heartbeat time of the drives, ns.
    pub(super) heartbeat_timeout_ns: u64,
    /// The time that a drive may take to boot, ns.
    pub(super) boot_timeout_ns: u64,
    /// Cycles without a command before the drives are stopped.
    pub(super) command_timeout_cycles: u32,
}

impl MasterSettings {
    /// The settings of a scenario's master.
    ///
    /// # Errors
    /// [`PlantError`] for buses, node ids and bit rates that cannot be used.
    pub(super) fn new(scenario: &Scenario) -> Result<Self, PlantError> {
        let can = &scenario.can;
        let (ports, ids) = (drive_ports(can)?, node_ids(can)?);
        let drives = std::array::from_fn(|axis| {
            let drive = scenario.drives.of_axis(axis);
            let scale = Scale { increment_m: drive.encoder_resolution_m, rated_force_n: drive.rated_force_n };
            let setup = DriveSetup::for_axis(scenario, axis);
            ExpectedDrive { id: ids[axis], bus: ports[axis].bus, scale, setup }
        });
        let rates = can.rates()?;
        let sync_bits = frame_bits(&sync::frame().promoted(can.format()));
        Ok(Self {
            id: NodeId::MASTER,
            drives,
            buses: can.buses.len(),
            sync_frame_ns: rates.duration_ns(sync_bits) - rates.nominal().bits_to_ns(INTERFRAME_BITS),
            heartbeat_ns: u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS,
            heartbeat_timeout_ns: u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS,
            boot_timeout_ns: u64::from(can.boot_timeout_ms) * MILLISECOND_NS,
            command_timeout_cycles: can.command_timeout_cycles,
        })
    }
}
