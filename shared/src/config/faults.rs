//! Faults on the buses: `[[faults]]`. On a simulated bus they act on any node, on a real bus only on the master's port.

use std::fmt::{self, Display, Formatter};
use std::iter;

use serde::{Deserialize, Serialize};

use super::can::{CanConfig, MASTER_NODE};
use super::error::ScenarioError;
use super::need::{require_not_negative, require_within};

/// The kind of the fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKindConfig {
    /// Frames are destroyed on the wire and repeated by their transmitter.
    Corrupt,
    /// A receiver loses frames without an error on the wire.
    Lose,
    /// Frames are held back by `delay_us` before they are queued for transmission.
    Delay,
    /// Frames arrive, and their transmitter repeats them.
    Duplicate,
    /// A node sends 8 bytes of 55h with identifier `id` (001h unless given) whenever the bus is idle.
    Babble,
    /// A node is disconnected.
    Disconnect,
    /// A node's controller goes off the bus.
    BusOff,
}

impl Display for FaultKindConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Corrupt => "corrupt",
            Self::Lose => "lose",
            Self::Delay => "delay",
            Self::Duplicate => "duplicate",
            Self::Babble => "babble",
            Self::Disconnect => "disconnect",
            Self::BusOff => "bus_off",
        })
    }
}

/// One fault.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// The kind of the fault.
    pub kind: FaultKindConfig,
    /// Bus, from 0.
    pub bus: usize,
    /// From when on, s since the rig was switched on.
    pub from_s: f64,
    /// Until when, s; to the end when absent.
    pub until_s: Option<f64>,
    /// Node id concerned: the sender of a frame, the receiver that loses it, or the node itself. All when
    /// absent; never absent where a node babbles, is cut off or goes off the bus.
    pub node: Option<u8>,
    /// COB-ID of the frames concerned, or of those that are babbled (11 bits); all when absent.
    pub id: Option<u16>,
    /// Probability that the fault acts on a frame, above 0 to 1; only for kinds that act on single frames.
    #[serde(default = "always")]
    pub probability: f64,
    /// Activations after which the fault ends; when absent one for bus-off, any number for the others. A disconnection ends by
    /// `until_s` alone.
    pub count: Option<u64>,
    /// How long a frame is delayed, µs.
    pub delay_us: Option<u32>,
}

const fn always() -> f64 {
    1.0
}

/// Kind and place: `lose (bus 1, node 4, id 204h)`.
impl Display for FaultConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} (bus {}", self.kind, self.bus)?;
        self.node.map_or(Ok(()), |node| write!(f, ", node {node}"))?;
        self.id.map_or(Ok(()), |id| write!(f, ", id {id:03X}h"))?;
        f.write_str(")")
    }
}

impl FaultConfig {
    /// Checks one fault of the list.
    pub(super) fn validate(&self, can: &CanConfig) -> Result<(), ScenarioError> {
        let Some(axes) = can.buses.get(self.bus) else {
            return refuse("faults.bus", &self.bus, "name a bus of can.buses, from 0");
        };
        if !can.is_virtual() {
            self.check_port()?;
        }
        let drives = axes.iter().filter_map(|&axis| can.node_ids.get(axis).copied());
        let nodes: Vec<u8> = iter::once(MASTER_NODE.get()).chain(drives).collect();
        if let Some(node) = self.node.filter(|node| !nodes.contains(node)) {
            let nodes = nodes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
            return refuse("faults.node", &node, format!("bus {} has the nodes {nodes}", self.bus));
        }
        self.check_ranges()?;
        self.check_kind()
    }

    /// Refuses faults that the port of a real interface cannot carry out.
    fn check_port(&self) -> Result<(), ScenarioError> {
        if self.kind == FaultKindConfig::Corrupt {
            let need = "leave it away with can.interfaces: only on a simulated bus can frames be destroyed on the wire";
            return refuse("faults.kind", &"corrupt", need);
        }
        if let Some(node) = self.node.filter(|&node| node != MASTER_NODE.get()) {
            let need =
                format!("on a real interface only the master (node {MASTER_NODE}) can be given faults");
            return refuse("faults.node", &node, need);
        }
        Ok(())
    }

    fn check_ranges(&self) -> Result<(), ScenarioError> {
        require_not_negative(&[("faults.from_s", self.from_s)])?;
        if let Some(until_s) = self.until_s.filter(|&until_s| !(until_s.is_finite() && until_s > self.from_s))
        {
            return refuse("faults.until_s", &until_s, "use a finite number above from_s");
        }
        require_within(&[("faults.probability", self.probability, 0.0, 1.0)])?;
        if self.probability == 0.0 {
            return refuse(
                "faults.probability",
                &0,
                "use more than 0, or leave the fault away: it would never act",
            );
        }
        if self.count == Some(0) {
            return refuse("faults.count", &0, "use at least 1, or leave the fault away: it would never act");
        }
        match self.id {
            Some(id) if id > 0x7FF => refuse("faults.id", &id, "use an 11-bit identifier, at most 0x7FF"),
            _ => Ok(()),
        }
    }

    /// Refuses keys that have no effect on this kind, and requires those that it needs.
    fn check_kind(&self) -> Result<(), ScenarioError> {
        use FaultKindConfig as Kind;
        let is_of_node = matches!(self.kind, Kind::Babble | Kind::Disconnect | Kind::BusOff);
        let has_no_effect = "leave it away: it has no effect on this kind";
        if is_of_node && self.probability < 1.0 {
            return refuse("faults.probability", &self.probability, has_no_effect);
        }
        if let Some(id) = self.id.filter(|_| matches!(self.kind, Kind::Disconnect | Kind::BusOff)) {
            return refuse("faults.id", &id, has_no_effect);
        }
        if let Some(count) = self.count.filter(|_| self.kind == Kind::Disconnect) {
            return refuse("faults.count", &count, has_no_effect);
        }
        if self.node.is_none() && is_of_node {
            return refuse(
                "faults.node",
                &"none",
                "name the node that babbles, is cut off or goes off the bus",
            );
        }
        if (self.kind == Kind::Delay) != self.delay_us.is_some() {
            let value = format!("{:?}", self.delay_us);
            return refuse("faults.delay_us", &value, "give it for kind = 'delay', and only there");
        }
        Ok(())
    }
}

fn refuse(key: &'static str, value: &dyn Display, need: impl Into<String>) -> Result<(), ScenarioError> {
    Err(ScenarioError::bad(key, value, need))
}
