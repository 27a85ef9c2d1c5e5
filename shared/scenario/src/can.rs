//! The CAN link: `[can]`.

use std::collections::BTreeSet;

use masseter_can::{Bitrate, BitrateError, canopen::NodeId};
use masseter_model::geometry::{AXES, AXIS_NAMES};

use super::error::{Checked, ScenarioError, ranges_of, require};
use crate::wording::counted;

/// The node id of the rig's master.
pub const MASTER_NODE: NodeId = match NodeId::new(127) {
    Ok(node) => node,
    Err(_) => unreachable!(),
};

section! {
    /// The CAN link between the master and the six drives.
    pub struct CanConfig {
        /// Real interfaces, such as `["can0", "can1"]`; empty for simulated buses.
        pub interfaces: Vec<String> = Vec::new() => "one a bus, none twice",
        /// Bit rate of every bus.
        pub bitrate_bps: u32 = 1_000_000 => "1 to 1000000",
        /// Whether a bit takes a nanosecond, whatever `bitrate_bps` is (simulated buses only): for cycles that no CAN
        /// holds.
        pub ideal: bool = false => "not with `interfaces`",
        /// Time from bus-off to the restart of a CAN controller, 0 for never; on real interfaces only for the
        /// scenario's faults.
        pub restart_ms: u32 = 100,
        /// The axes (0 to 5: d₁ d₂ d₃ l₁ l₂ l₃) on each bus.
        pub buses: Vec<Vec<usize>> = vec![vec![0, 1, 2], vec![3, 4, 5]] => "each axis once, no bus empty",
        /// Node id of each axis' drive; 127 is the master.
        pub node_ids: [u8; AXES] = [1, 2, 3, 4, 5, 6] => "1 to 126, none twice",
        /// Heartbeat of the master and of every drive (object 1017).
        pub heartbeat_producer_ms: u16 = 50 => "at least 1",
        /// Silence after which a heartbeat is lost (1016).
        #[doc(alias = "consumer heartbeat time")]
        pub heartbeat_consumer_ms: u16 = 150 => Positive "at least `heartbeat_producer_ms` and two cycles together",
        /// Longest time from SYNC until a drive has its process data ready.
        pub answer_us: u32 = 0 => "as long as the cycle holds it",
        /// Longest time for the drives to boot.
        pub boot_timeout_ms: u32 = 2000 => Positive,
        /// Whether a fault that a drive has at the start is reset (`run --reset-faults`); otherwise the run ends and
        /// names the fault.
        pub reset_faults: bool = false,
        /// Longest time for which the drives wait for one that is not ready to switch on, such as one with safe torque
        /// off (`run --wait-ready`).
        pub ready_timeout_ms: u32 = 5000 => Positive,
        /// Longest time from the moment when all drives are ready until all are enabled: a second for brakes that open
        /// late, half a second for the drives.
        pub enable_timeout_ms: u32 = 1500 => Positive,
        /// Cycles without a fresh command before the master quick-stops the drives.
        pub command_timeout_cycles: u32 = 20 => Positive,
        /// Distance of a drive from where its targets should have taken it, beyond which the master quick-stops the
        /// drives. The default is twice the largest distance of the examples. It is less than half of what the second
        /// missed target costs at the fastest default motion. While SYNC or targets come unevenly and for 12 cycles
        /// after, three steps of the target more.
        pub following_limit_m: f64 = 7.5e-5 => Positive,
        /// Positions in a row beyond that distance before the master quick-stops the drives.
        pub following_limit_cycles: u32 = 1 => Positive,
        /// Silence of the process data before a drive stops by itself (1400h:05), 0 for never; by default
        /// `heartbeat_consumer_ms` or `command_timeout_cycles`, whichever is longer. A drive may refuse it.
        pub rpdo_timeout_ms: Option<u16> = None => "0, or more than two cycles",
    }
}

impl CanConfig {
    /// Whether the buses are simulated.
    pub fn is_virtual(&self) -> bool {
        self.interfaces.is_empty()
    }

    /// The master's longest time for enabling the drives, s.
    pub fn longest_enabling_s(&self) -> f64 {
        f64::from(self.ready_timeout_ms) * 1e-3 + f64::from(self.enable_timeout_ms) * 1e-3
    }

    /// Bit rate of every bus.
    pub fn bitrate(&self) -> Result<Bitrate, BitrateError> {
        let bitrate = Bitrate::new(self.bitrate_bps)?;
        Ok(if self.ideal { Bitrate::IDEAL } else { bitrate })
    }

    /// Checks that each axis has its place on one bus, and each bus an axis.
    ///
    /// # Errors
    /// [`ScenarioError::BadValue`] for another division of the axes.
    pub fn check_buses(&self) -> Result<(), ScenarioError> {
        let refused = |need: String| ScenarioError::bad("can.buses", &format_args!("{:?}", self.buses), need);
        if let Some(bus) = self.buses.iter().position(Vec::is_empty) {
            return Err(refused(format!(
                "bus {bus} has no drive, so no node would acknowledge the master's frames; remove this bus"
            )));
        }
        let named = || self.buses.iter().flatten().copied();
        let times = |axis: usize| named().filter(|&other| other == axis).count();
        let unknown = named().find(|&axis| axis >= AXES);
        match unknown.or_else(|| (0..AXES).find(|&axis| times(axis) != 1)) {
            Some(axis) => Err(refused(format!(
                "axis {axis} is named {}; name each of the axes 0 to {} ({}) once",
                counted(times(axis) as u64, "time"),
                AXES - 1,
                AXIS_NAMES.join(" ")
            ))),
            None => Ok(()),
        }
    }

    pub(super) fn validate(&self) -> Checked {
        let need = "use at least 1 ms: a heartbeat shows that a node works";
        require(self.heartbeat_producer_ms > 0, "can.heartbeat_producer_ms", &0, need)?;
        self.check_ranges(ranges_of("can"))?;
        for (axis, id) in self.node_ids.iter().enumerate() {
            let is_free = (1..MASTER_NODE.get()).contains(id) && !self.node_ids[..axis].contains(id);
            let need = format!("use 1 to 126, none twice; {MASTER_NODE} is the master");
            require(is_free, "can.node_ids", id, need)?;
        }
        self.check_buses()?;
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
