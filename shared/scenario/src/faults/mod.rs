//! Faults of every layer: `[[faults]]`. On real interfaces, faults of the bus act only on the master's port.

mod kinds;

use std::fmt::{self, Display, Formatter};
use std::iter;

use masseter_model::geometry::AXIS_NAMES;
use serde::{Deserialize, Serialize};

use super::can::{CanConfig, MASTER_NODE};
use super::error::{Checked, ScenarioError, bounded, require, require_keys, require_name, require_within};
use super::quantity::Quantity;
use super::when::{EntryNames, When, WhenKeys};

pub use kinds::{
    AxisFault, BusFault, CommandFault, DriveFault, EncoderFault, FaultDeclaration, FaultKindConfig,
    FaultSize, PlatformFault, ProcessFault,
};

/// One fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultConfig {
    /// The kind of the fault.
    pub kind: FaultKindConfig,
    /// Its name in requirements and in `after`; that of its kind when absent.
    pub name: Option<String>,
    /// From when on, s since the motion began, or since `after`.
    pub at_s: Option<f64>,
    /// What `at_s` counts from: `fault.NAME`, `stimulus.NAME` or `controller.STATE`.
    pub after: Option<String>,
    /// For how long, s; to the end when absent.
    pub for_s: Option<f64>,
    /// From when on, s since the rig was switched on: instead of `at_s`.
    pub from_s: Option<f64>,
    /// Until when, s since the rig was switched on: instead of `for_s`.
    pub until_s: Option<f64>,
    /// Bus, from 0.
    pub bus: Option<usize>,
    /// Node id concerned: the sender of a frame, the receiver that loses it, or the node itself. All when
    /// absent; never absent where a node babbles, is cut off or goes off the bus.
    pub node: Option<u8>,
    /// COB-ID of the frames concerned, or of those that are babbled (11 bits); all when absent.
    pub id: Option<u16>,
    /// Bytes of the frames that are babbled, at most eight.
    pub data: Option<Vec<u8>>,
    /// Axis concerned: d1 to l3.
    pub axis: Option<String>,
    /// How much, with its unit; what that is depends on the kind.
    pub size: Option<Quantity>,
    /// Probability that the fault acts on a frame, above 0 to 1; only for kinds that act on single frames.
    #[serde(default = "always")]
    pub probability: f64,
    /// Activations after which the fault ends; when absent one for bus-off, any number for the others. A disconnection ends by
    /// its time alone.
    pub count: Option<u64>,
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
    /// A fault of that kind, with no time and no place yet.
    pub fn new(kind: impl Into<FaultKindConfig>) -> Self {
        Self {
            kind: kind.into(),
            name: None,
            at_s: None,
            after: None,
            for_s: None,
            from_s: None,
            until_s: None,
            bus: None,
            node: None,
            id: None,
            data: None,
            axis: None,
            size: None,
            probability: 1.0,
            count: None,
        }
    }

    /// Its name in requirements.
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or(self.kind.name())
    }

    /// The place of its axis; none where it has none.
    pub fn axis(&self) -> Option<usize> {
        let name = self.axis.as_deref()?;
        AXIS_NAMES.iter().position(|axis| *axis == name)
    }

    /// Its size in SI units; 0 where it has none.
    pub fn size_si(&self) -> f64 {
        self.size.map_or(0.0, |size| size.si())
    }

    /// When it acts.
    ///
    /// # Errors
    /// Where that is missing, contradictory, or names nothing of the scenario.
    pub fn when(&self, entries: &EntryNames<'_>) -> Result<When, ScenarioError> {
        let names = ["faults.at_s", "faults.after", "faults.for_s", "faults.from_s", "faults.until_s"];
        let Self { at_s, after, for_s, from_s, until_s, .. } = self;
        let after = after.as_deref();
        WhenKeys { names, at_s: *at_s, after, for_s: *for_s, from_s: *from_s, until_s: *until_s }
            .resolve(entries)
    }

    /// Checks one fault of the list.
    pub(super) fn validate(&self, can: &CanConfig, entries: &EntryNames<'_>) -> Checked {
        self.when(entries)?;
        self.name.as_ref().map_or(Ok(()), |name| require_name("faults.name", name))?;
        self.require_keys()?;
        let (name, is_axis) = (self.axis.as_deref().unwrap_or_default(), self.axis().is_some());
        require(is_axis || self.axis.is_none(), "faults.axis", &name, self.need_of("faults.axis"))?;
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

    /// Refuses keys that have no effect on this kind, and requires those that it needs.
    fn require_keys(&self) -> Checked {
        let given = [
            ("faults.bus", self.bus.is_some()),
            ("faults.node", self.node.is_some()),
            ("faults.id", self.id.is_some()),
            ("faults.data", self.data.is_some()),
            ("faults.axis", self.axis.is_some()),
            ("faults.size", self.size.is_some()),
            ("faults.probability", self.probability < 1.0),
            ("faults.count", self.count.is_some()),
        ];
        let FaultDeclaration { name, needs, takes, .. } = self.kind.declared();
        require_keys(name, [needs, takes], &given, |key| self.need_of(key))
    }

    /// What a missing key must say.
    fn need_of(&self, key: &str) -> String {
        match (key, self.kind.declared().size) {
            ("faults.bus", _) => "name a bus of can.buses, from 0".to_owned(),
            ("faults.node", _) => "name the node that babbles, is cut off or goes off the bus".to_owned(),
            ("faults.size", Some(size)) => format!("give {}, such as \"{}\"", size.about, size.example),
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
        require_within(&bounded!("faults", self, probability [0.0, 1.0]))?;
        let need = "use more than 0, or leave the fault away: it would never act";
        require(self.probability > 0.0, "faults.probability", &0, need)?;
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
            return Err(ScenarioError::bad("faults.bus", &bus, self.need_of("faults.bus")));
        };
        if !can.is_virtual() {
            self.require_port(kind)?;
        }
        let Some(node) = self.node else { return Ok(()) };
        let drives = axes.iter().filter_map(|&axis| can.node_ids.get(axis).copied());
        let nodes: Vec<u8> = iter::once(MASTER_NODE.get()).chain(drives).collect();
        let names = nodes.iter().map(u8::to_string).collect::<Vec<_>>().join(", ");
        let need = format!("bus {bus} has the nodes {names}");
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
