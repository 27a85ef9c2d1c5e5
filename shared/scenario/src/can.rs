//! The CAN link: `[can]`.

use std::collections::BTreeSet;

use masseter_can::canopen::NodeId;
use masseter_can::{Bitrate, BitrateError};
use masseter_model::geometry::AXES;

use super::error::{Checked, ScenarioError, keyed, require, require_positive};
use crate::wording::counted;

/// The node id of the rig's master.
pub const MASTER_NODE: NodeId = match NodeId::new(127) {
    Ok(node) => node,
    Err(_) => unreachable!(),
};

section! {
    /// The CAN link between the master and the six drives.
    pub struct CanConfig {
        /// Real interfaces, one a bus, such as `["can0", "can1"]`; none for simulated buses.
        pub interfaces: Vec<String> = Vec::new(),
        /// Bit rate of every bus, bit/s.
        pub bitrate_bps: u32 = 1_000_000,
        /// Whether a bit takes a nanosecond, whatever `bitrate_bps` is (simulated buses only): for cycles that no CAN
        /// holds.
        pub ideal: bool = false,
        /// How long after bus-off a controller restarts by itself, ms; 0 for never (as `ip link … restart-ms`).
        /// On real interfaces only for faults of the scenario; their own setting holds otherwise.
        pub restart_ms: u32 = 100,
        /// The axes (0 to 5: d₁ d₂ d₃ l₁ l₂ l₃) on each bus.
        pub buses: Vec<Vec<usize>> = vec![vec![0, 1, 2], vec![3, 4, 5]],
        /// Node id of each axis, in the axis order.
        pub node_ids: [u8; AXES] = [1, 2, 3, 4, 5, 6],
        /// Heartbeat of the master and of every drive (object 1017), ms.
        pub heartbeat_producer_ms: u16 = 50,
        /// Silence after which a heartbeat counts as lost (object 1016), ms.
        #[doc(alias = "consumer heartbeat time")]
        pub heartbeat_consumer_ms: u16 = 150,
        /// From SYNC to the moment a drive has its process data ready to be sent, at most, µs; none for the
        /// emulated drives on simulated buses.
        pub answer_us: u32 = 0,
        /// How long the drives may take to boot, ms.
        pub boot_timeout_ms: u32 = 2000,
        /// Whether a fault that a drive has at the start is reset. Otherwise the run ends and names the fault.
        pub reset_faults: bool = false,
        /// How long the drives wait for one that is not ready to switch on, such as one with safe torque off, ms.
        pub ready_timeout_ms: u32 = 5000,
        /// How long the drives may take from "ready to switch on" until all are enabled, ms. Brakes take up to a second to
        /// open; the rest is for the drive.
        pub enable_timeout_ms: u32 = 1500,
        /// Cycles without a fresh command after which the master quick-stops the drives.
        pub command_timeout_cycles: u32 = 20,
        /// Distance of a drive from where its targets should have taken it, m. Drives that follow are within half of
        /// it, also with food. At the fastest default motion a leg goes 0.116 mm a cycle, so that two missed targets in
        /// a row exceed it.
        pub following_limit_m: f64 = 7.5e-5,
        /// Positions in a row beyond that distance after which the master quick-stops the drives.
        pub following_limit_cycles: u32 = 1,
        /// Silence of the process data after which a drive stops by itself (object 1400h:05), ms; 0 for never. By
        /// default as long as the heartbeat may be missing, or commands, whichever is longer.
        pub rpdo_timeout_ms: Option<u16> = None,
    }
}

impl CanConfig {
    /// Whether the buses are simulated.
    pub fn is_virtual(&self) -> bool {
        self.interfaces.is_empty()
    }

    /// The longest time from the request to enable the drives until the master gives up, s.
    pub fn longest_enabling_s(&self) -> f64 {
        f64::from(self.ready_timeout_ms) * 1e-3 + f64::from(self.enable_timeout_ms) * 1e-3
    }

    /// Bit rate of every bus.
    pub fn bitrate(&self) -> Result<Bitrate, BitrateError> {
        let bitrate = Bitrate::new(self.bitrate_bps)?;
        Ok(if self.ideal { Bitrate::IDEAL } else { bitrate })
    }

    pub(super) fn validate(&self) -> Checked {
        let need = "use at least 1 ms: a heartbeat shows that a node works";
        require(self.heartbeat_producer_ms > 0, "can.heartbeat_producer_ms", &0, need)?;
        require_positive(&keyed!("can", self,
            heartbeat_consumer_ms boot_timeout_ms ready_timeout_ms enable_timeout_ms command_timeout_cycles following_limit_m
            following_limit_cycles
        ))?;
        for (axis, id) in self.node_ids.iter().enumerate() {
            let is_free = (1..MASTER_NODE.get()).contains(id) && !self.node_ids[..axis].contains(id);
            let need = format!("use 1 to 126, none twice; {MASTER_NODE} is the master");
            require(is_free, "can.node_ids", id, need)?;
        }
        let need = "leave it away with can.interfaces: it replaces their bit rate";
        require(self.is_virtual() || !self.ideal, "can.ideal", &true, need)?;
        self.bitrate().map_err(|error| ScenarioError::bad("can.bitrate_bps", &self.bitrate_bps, error))?;
        let distinct = self.interfaces.iter().collect::<BTreeSet<_>>().len();
        let is_one_a_bus = [self.interfaces.len(), distinct] == [self.buses.len(); 2];
        let buses = counted(self.buses.len() as u64, "interface");
        let need = format!("name {buses}, one for each of can.buses");
        require(self.is_virtual() || is_one_a_bus, "can.interfaces", &self.interfaces.join(","), need)
    }
}
