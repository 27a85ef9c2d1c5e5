//! Faults of every layer: `[[faults]]`. On real interfaces, faults of the bus act only on the master's port.

mod kinds;

use std::fmt::{self, Display, Formatter};
use std::{iter, ops::Range};

use masseter_model::geometry::AXIS_NAMES;
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::can::{CanConfig, MASTER_NODE};
use super::error::{Checked, LONGEST_S, ScenarioError, ranges_of, require, require_keys, require_name};
use super::quantity::Quantity;
use super::when::{EntryNames, When, WhenKeys};
use crate::wording::listed;

pub use kinds::*;

keys! {
    /// One fault.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields)]
    pub struct FaultConfig {
        /// The kind of fault.
        pub kind: FaultKindConfig => "as above",
        /// Name in requirements and in `after`; by default that of the kind.
        pub name: Option<String> => "1 to 64 lower-case letters, digits, `_`",
        /// Beginning, since the motion began or since `after`; this or `from_s` is required.
        pub at_s: Option<f64> => NotNegative,
        /// What `at_s` counts from.
        pub after: Option<String> => "`fault.NAME`, `stimulus.NAME`, `controller.STATE`; no circle",
        /// How long the fault acts; by default to the end of the run.
        pub for_s: Option<f64> => UpTo(LONGEST_S),
        /// Beginning, since the rig was switched on, instead of `at_s`.
        pub from_s: Option<f64> => NotNegative,
        /// End, since the rig was switched on, instead of `for_s`.
        pub until_s: Option<f64> => "above `from_s`",
        /// The bus.
        pub bus: Option<usize> => "a bus of `can.buses`, from 0",
        /// The sender of a frame, the receiver that loses it, or the node itself; by default all.
        pub node: Option<u8> => "a node of the bus",
        /// COB-ID of the frames, by default all; for `babble` that of its frames, by default 001h.
        pub id: Option<u16> => "0 to 0x7FF",
        /// Bytes of the frames of `babble`. With `id = 0`, `count = 1` and the bytes `[0x81, 4]` another master resets node
        /// 4.
        pub data: Option<Vec<u8>> => "up to 8 bytes, such as `[0x81, 4]`",
        /// The axis.
        pub axis: Option<String> => "`d1` to `l3`",
        /// How much.
        pub size: Option<Quantity> => "as above, with its unit, such as `\"0.5 mm\"`",
        /// Chance that the fault acts on a frame.
        #[serde(default = "always")]
        pub probability: f64 => UpTo(1.0),
        /// Activations after which the fault ends; by default one for `bus_off`, unlimited for the others.
        pub count: Option<u64> => "above 0",
    }
}

const fn always() -> f64 {
    1.0
}

/// Kind and place: `lose (bus 1, node 4, id 204h)`, `encoder_stuck (l2)`.
impl Display for FaultConfig {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let parts = [
            self.bus.map(|bus| format!("bus {bus}")),
            self.node.map(|node| format!("node {node}")),
            self.id.map(|id| format!("id {id:03X}h")),
            self.axis.clone(),
            self.size.map(|size| size.to_string()),
        ];
        let parts: Vec<_> = parts.into_iter().flatten().collect();
        let place = if parts.is_empty() { String::new() } else { format!(" ({})", parts.join(", ")) };
        write!(f, "{}{place}", self.kind)
    }
}

impl FaultConfig {
    /// A fault of that kind without time and place.
    pub fn new(kind: impl Into<FaultKindConfig>) -> Self {
        let kind: FaultKindConfig = kind.into();
        serde_json::from_value(json!({ "kind": kind })).expect("a kind alone is a fault")
    }

    /// Its name in requirements.
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or(self.kind.name())
    }

    /// The place of its axis; none without an axis.
    pub fn axis(&self) -> Option<usize> {
        let name = self.axis.as_deref()?;
        AXIS_NAMES.iter().position(|axis| *axis == name)
    }

    /// Its size in SI units; 0 without a size.
    pub fn size_si(&self) -> f64 {
        self.size.map_or(0.0, |size| size.si())
    }

    /// The part of a window (ns) in which the fault acts: for some kinds, the size is the duration.
    pub fn acting_ns(&self, window_ns: Range<u64>) -> Range<u64> {
        let lasts_its_size = [DriveFault::Reboot.into(), CommandFault::ControllerStall.into()];
        if !lasts_its_size.contains(&self.kind) {
            return window_ns;
        }
        let longest_ns = (self.size_si() * 1e9).round() as u64;
        window_ns.start..window_ns.end.min(window_ns.start.saturating_add(longest_ns))
    }

    /// The time of the fault.
    ///
    /// # Errors
    /// For a time that is missing, contradictory, or names no entry of the scenario.
    pub fn when(&self, entries: &EntryNames<'_>) -> Result<When, ScenarioError> {
        let Self { at_s, ref after, for_s, from_s, until_s, .. } = *self;
        let keys = WhenKeys { at_s, after: after.as_deref(), for_s, from_s, until_s };
        keys.resolve(entries).map_err(|refusal| refusal.in_table("faults"))
    }

    /// Checks one fault of the list.
    pub(super) fn validate(&self, can: &CanConfig, entries: &EntryNames<'_>) -> Checked {
        self.when(entries)?;
        self.name.as_ref().map_or(Ok(()), |name| require_name("faults.name", name))?;
        self.require_keys()?;
        let (name, is_axis) = (self.axis.as_deref().unwrap_or_default(), self.axis().is_some());
        require(is_axis || self.axis.is_none(), "faults.axis", &name, self.need_of("axis"))?;
        self.require_size()?;
        self.require_ranges()?;
        match self.kind {
            FaultKindConfig::Bus(kind) => self.require_bus(kind, can),
            FaultKindConfig::Encoder(_)
            | FaultKindConfig::Drive(_)
            | FaultKindConfig::Axis(_)
            | FaultKindConfig::Platform(_) => {
                let need = "leave it away with can.interfaces: real drives take no such fault";
                require(can.is_virtual(), "faults.kind", &self.kind, need)
            }
            FaultKindConfig::Command(_) | FaultKindConfig::Process(_) => Ok(()),
        }
    }

    /// Refuses keys without effect on this kind, and requires the keys that the kind needs.
    fn require_keys(&self) -> Checked {
        let FaultDeclaration { name, needs, takes, .. } = self.kind.declared();
        let of_any = |key: &&str| FaultKindConfig::ALL.iter().any(|kind| kind.takes(key));
        let keys = Self::KEYS.iter().map(|key| key.name).filter(of_any);
        require_keys(name, [needs, takes], keys, [self, &Self::new(self.kind)], |key| self.need_of(key))
            .map_err(|refusal| refusal.in_table("faults"))
    }

    /// The valid values of a missing key.
    fn need_of(&self, key: &str) -> String {
        match (key, self.kind.declared().size) {
            ("bus", _) => "name a bus of can.buses, from 0".to_owned(),
            ("node", _) => "name the node that babbles, is cut off or goes off the bus".to_owned(),
            ("size", Some(size)) => format!("give {}, such as \"{}\"", size.about, size.example),
            _ => format!("name an axis: {}", AXIS_NAMES.join(", ")),
        }
    }

    fn require_size(&self) -> Checked {
        let Some((given, size)) = self.size.zip(self.kind.declared().size) else { return Ok(()) };
        let si =
            given.si_of(size.dimension).map_err(|need| ScenarioError::bad("faults.size", &given, need))?;
        let unit = size.dimension.si_unit();
        let need = format!("use {} to {}: {}", unit.text(size.min), unit.text(size.max), size.about);
        require((size.min..=size.max).contains(&si), "faults.size", &given, need)
    }

    fn require_ranges(&self) -> Checked {
        self.check_ranges(ranges_of("faults"))?;
        let need = "use at least 1, or leave the fault away: it would never act";
        require(self.count != Some(0), "faults.count", &0, need)?;
        let bytes = self.data.as_ref().map_or(0, Vec::len);
        let need = "a frame has at most 8 bytes";
        require(bytes <= 8, "faults.data", &format_args!("{bytes} bytes"), need)?;
        let id = self.id.unwrap_or_default();
        require(id <= 0x7FF, "faults.id", &id, "use an 11-bit identifier, at most 0x7FF")
    }

    fn require_bus(&self, kind: BusFault, can: &CanConfig) -> Checked {
        let bus = self.bus.unwrap_or_default();
        let Some(axes) = can.buses.get(bus) else {
            return Err(ScenarioError::bad("faults.bus", &bus, self.need_of("bus")));
        };
        if !can.is_virtual() {
            self.require_port(kind)?;
        }
        let Some(node) = self.node else { return Ok(()) };
        let drives = axes.iter().filter_map(|&axis| can.node_ids.get(axis).copied());
        let nodes: Vec<u8> = iter::once(MASTER_NODE.get()).chain(drives).collect();
        let need = format!("bus {bus} has the nodes {}", listed(&nodes));
        require(nodes.contains(&node), "faults.node", &node, need)
    }

    /// Refuses faults that the port of a real interface cannot carry out.
    fn require_port(&self, kind: BusFault) -> Checked {
        let need =
            "leave it away with can.interfaces: only on a simulated bus can frames be destroyed on the wire";
        require(kind != BusFault::Corrupt, "faults.kind", &self.kind, need)?;
        let node = self.node.unwrap_or(MASTER_NODE.get());
        let need = format!("on a real interface only the master (node {MASTER_NODE}) can be given faults");
        require(node == MASTER_NODE.get(), "faults.node", &node, need)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dip_of_the_supply_lasts_as_long_as_its_size_says_and_no_longer_than_its_window() {
        let size = Some("20 ms".parse().unwrap());
        let dip = FaultConfig { size, ..FaultConfig::new(DriveFault::Reboot) };
        assert_eq!(dip.acting_ns(1000..u64::MAX), 1000..20_001_000);
        assert_eq!(dip.acting_ns(1000..5000), 1000..5000);
        let slow = FaultConfig { kind: DriveFault::SlowEnable.into(), ..dip };
        assert_eq!(slow.acting_ns(1000..u64::MAX), 1000..u64::MAX);
    }
}
