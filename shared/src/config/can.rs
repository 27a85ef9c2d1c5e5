//! The CAN link: `[can]`.

use masseter_can::{Bitrate, BitrateError, FrameFormat, Rates};
use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::need::{keyed, require_positive};
use crate::geometry::AXES;

section! {
    /// The CAN link between the master and the six drives.
    pub struct CanConfig {
        /// Real interfaces, one a bus, such as `["can0", "can1"]`; none for simulated buses.
        pub interfaces: Vec<String> = Vec::new(),
        /// Bit rate of every bus, bit/s.
        pub bitrate_bps: u32 = 1_000_000,
        /// Whether a bit takes a nanosecond, whatever `bitrate_bps` says (simulated buses only): for cycles that no CAN
        /// holds.
        pub ideal: bool = false,
        /// Whether frames go in FD format with bit-rate switch. Real interfaces must have been set up for it.
        pub fd: bool = false,
        /// Bit rate of the data phase of FD frames, bit/s.
        pub data_bitrate_bps: u32 = 5_000_000,
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
        /// The identity that every drive must report.
        pub identity: IdentityConfig = IdentityConfig::default(),
        /// How long the drives may take to boot, ms.
        pub boot_timeout_ms: u32 = 2000,
        /// Cycles without a fresh command after which the master quick-stops the drives.
        pub command_timeout_cycles: u32 = 20,
    }
}

impl CanConfig {
    /// Whether the buses are simulated.
    pub fn is_virtual(&self) -> bool {
        self.interfaces.is_empty()
    }

    /// Bit rates of every bus.
    pub fn rates(&self) -> Result<Rates, BitrateError> {
        let nominal = Bitrate::new(self.bitrate_bps)?;
        if self.ideal {
            return Ok(Rates::classical(Bitrate::IDEAL));
        }
        if self.fd { Rates::switching(nominal, self.data_bitrate_bps) } else { Ok(Rates::classical(nominal)) }
    }

    /// The format of every frame.
    pub fn format(&self) -> FrameFormat {
        if self.fd { FrameFormat::FdBitRateSwitch } else { FrameFormat::Classical }
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        if self.heartbeat_producer_ms == 0 {
            let need = "use at least 1 ms: a heartbeat shows that a node works";
            return Err(ScenarioError::bad("can.heartbeat_producer_ms", &0, need));
        }
        require_positive(&keyed!("can", self,
            heartbeat_consumer_ms boot_timeout_ms command_timeout_cycles
        ))?;
        if self.ideal && (self.fd || !self.is_virtual()) {
            let need = "leave it away with can.fd and can.interfaces: it replaces their bit rates";
            return Err(ScenarioError::bad("can.ideal", &true, need));
        }
        if let Err(error) = self.rates() {
            let (key, bps) = match error {
                BitrateError::Nominal { bps } => ("can.bitrate_bps", bps),
                BitrateError::Data { bps, .. } => ("can.data_bitrate_bps", bps),
            };
            return Err(ScenarioError::bad(key, &bps, error.to_string()));
        }
        let names = &self.interfaces;
        let has_twice = (1..names.len()).any(|index| names[..index].contains(&names[index]));
        if self.is_virtual() || names.len() == self.buses.len() && !has_twice {
            return Ok(());
        }
        let need = format!("name {} interfaces, one for each of can.buses", self.buses.len());
        Err(ScenarioError::bad("can.interfaces", &names.join(","), need))
    }
}

/// The identity that the master checks before it writes to a drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct IdentityConfig {
    /// Device type (object 1000).
    pub device_type: u32,
    /// Vendor (object 1018:01).
    pub vendor_id: u32,
    /// Product (object 1018:02).
    pub product_code: u32,
    /// Revision (object 1018:03).
    pub revision: u32,
}

impl IdentityConfig {
    /// The emulated drives: servo drives of CiA 402. The vendor number is not registered with
    /// CiA.
    pub const EMULATED: Self = Self {
        device_type: 0x0002_0192,
        vendor_id: 0x004D_5354,
        product_code: 0x0000_0402,
        revision: 0x0001_0000,
    };
}

impl Default for IdentityConfig {
    fn default() -> Self {
        Self::EMULATED
    }
}
