//! Faults that a scenario asks for on its buses: `[[faults]]`. On a simulated bus they strike any node; on a real one,
//! only what the master's port can do to itself.

use serde::{Deserialize, Serialize};

use super::ScenarioError;
use crate::can::canopen::NodeId;

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKindConfig {
    /// Frames are destroyed on the wire and repeated by their transmitter.
    Corrupt,
    /// A receiver loses frames without anybody noticing.
    Lose,
    /// Frames are held back by `delay_us` before they are queued for transmission.
    Delay,
    /// Frames arrive, and are repeated by their transmitter all the same.
    Duplicate,
    /// A node sends 8 bytes of 55h with identifier `id` (001h unless given) whenever the bus is idle.
    Babble,
    /// A node is cut off the wire.
    Disconnect,
    /// A node's controller goes off the bus.
    BusOff,
}

/// One fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// What goes wrong.
    pub kind: FaultKindConfig,
    /// Bus, from 0.
    pub bus: usize,
    /// From when on, s since the rig was switched on.
    pub from_s: f64,
    /// Until when, s; to the end when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until_s: Option<f64>,
    /// Node id concerned: the sender of a frame, the receiver that loses it, or the node itself. All when
    /// absent; never absent where a node babbles, is cut off or goes off the bus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub node: Option<u8>,
    /// COB-ID of the frames concerned, or of those that are babbled (11 bits); all when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub id: Option<u16>,
    /// Chance that a frame is struck, 0 to 1; only of kinds that strike single frames.
    #[serde(default = "always")]
    pub probability: f64,
    /// Strikes after which it is over; when absent one for going off the bus, any number for the others. A disconnection is over by `until_s` alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// How long a frame is delayed, µs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_us: Option<u32>,
}

const fn always() -> f64 {
    1.0
}

impl FaultConfig {
    /// Checks one fault of the list on so many buses.
    pub(super) fn validate(&self, buses: usize, is_virtual: bool) -> Result<(), ScenarioError> {
        use FaultKindConfig as Kind;
        let refuse = |key, value: String, need: &str| {
            Err(ScenarioError::BadValue { key, value, need: need.to_owned() })
        };
        if !is_virtual && self.kind == Kind::Corrupt {
            return refuse(
                "faults.kind",
                "corrupt".to_owned(),
                "leave it away with can.interfaces: only on a simulated bus can frames be destroyed on the wire",
            );
        }
        if let Some(node) = self.node.filter(|&node| !is_virtual && node != NodeId::MASTER.get()) {
            return refuse(
                "faults.node",
                node.to_string(),
                &format!("on a real interface only the master (node {}) can be given faults", NodeId::MASTER),
            );
        }
        if self.bus >= buses {
            return refuse("faults.bus", self.bus.to_string(), "name a bus of can.buses, from 0");
        }
        if !(self.from_s.is_finite() && self.from_s >= 0.0) {
            return refuse("faults.from_s", self.from_s.to_string(), "use a finite number not below 0");
        }
        if let Some(until_s) = self.until_s.filter(|&until_s| !(until_s.is_finite() && until_s > self.from_s))
        {
            return refuse("faults.until_s", until_s.to_string(), "use a finite number above from_s");
        }
        if !(0.0..=1.0).contains(&self.probability) {
            return refuse("faults.probability", self.probability.to_string(), "use 0 to 1");
        }
        if let Some(id) = self.id.filter(|&id| id > 0x7FF) {
            return refuse("faults.id", id.to_string(), "use an 11-bit identifier, at most 0x7FF");
        }
        let is_of_node = matches!(self.kind, Kind::Babble | Kind::Disconnect | Kind::BusOff);
        let has_no_effect = "leave it away: it has no effect on this kind";
        if is_of_node && self.probability < 1.0 {
            return refuse("faults.probability", self.probability.to_string(), has_no_effect);
        }
        if let Some(id) = self.id.filter(|_| matches!(self.kind, Kind::Disconnect | Kind::BusOff)) {
            return refuse("faults.id", id.to_string(), has_no_effect);
        }
        if let Some(count) = self.count.filter(|_| self.kind == Kind::Disconnect) {
            return refuse("faults.count", count.to_string(), has_no_effect);
        }
        if self.node.is_none() && is_of_node {
            return refuse(
                "faults.node",
                "none".to_owned(),
                "name the node that babbles, is cut off or goes off the bus",
            );
        }
        if (self.kind == Kind::Delay) != self.delay_us.is_some() {
            return refuse(
                "faults.delay_us",
                format!("{:?}", self.delay_us),
                "give it for kind = 'delay', and only there",
            );
        }
        Ok(())
    }
}
