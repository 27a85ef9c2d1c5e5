//! The scenario's faults as faults of a wire: node ids become ports, seconds become the wire's time.
//!
//! This module injects nothing; the wires do.

use std::ops::Range;

use masseter_can::canopen::NodeId;
use masseter_can::faults::{Fault, FaultKind};
use masseter_can::{CanId, Frame};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_runtime::injection::{Injected, Injection};
use masseter_scenario::{CanConfig, FaultConfig, FaultKindConfig, Scenario};

use crate::error::PlantError;

/// Identifier and data of a babbling node, unless the scenario sets others: only NMT has a higher priority.
const BABBLE_ID: u16 = 0x001;
const BABBLE_DATA: [u8; 8] = [0x55; 8];

/// Seed of a bus' faults: each bus makes choices of its own.
pub(crate) fn fault_seed(scenario: &Scenario, bus: usize) -> u64 {
    scenario.seed.wrapping_add(bus as u64)
}

/// Time after which a controller in bus-off is restarted; none where it is not, ns.
pub(crate) fn restart_after_ns(can: &CanConfig) -> Option<u64> {
    (can.restart_ms > 0).then(|| u64::from(can.restart_ms) * MILLISECOND_NS)
}

/// The faults of a bus whose ports have these nodes, switched on at `now_ns`. A fault's number is its index in the
/// scenario's list. A fault whose time is not known at switch-on does not act before it is set.
pub(crate) fn faults_of_bus(
    scenario: &Scenario,
    bus: usize,
    nodes: &[NodeId],
    now_ns: u64,
) -> Result<Vec<Fault>, PlantError> {
    let injection =
        Injection::new(scenario, now_ns).map_err(|error| PlantError::Scenario(error.to_string()))?;
    let of_bus = scenario.faults.iter().enumerate().filter(|(_, config)| config.bus == Some(bus));
    let fault = |(number, config): (usize, &FaultConfig)| {
        let window_ns = injection.window_ns(Injected::Fault(number)).unwrap_or(u64::MAX..u64::MAX);
        Ok(fault(number, config, port_of(config, nodes)?, window_ns))
    };
    of_bus.map(fault).collect()
}

fn fault(number: usize, config: &FaultConfig, port: Option<usize>, window_ns: Range<u64>) -> Fault {
    Fault {
        number,
        kind: kind(config),
        from_ns: window_ns.start,
        until_ns: window_ns.end,
        id: config.id.filter(|_| config.kind != FaultKindConfig::Babble).map(standard),
        port,
        probability: config.probability,
        count: config.count.unwrap_or(if config.kind == FaultKindConfig::BusOff { 1 } else { u64::MAX }),
    }
}

fn kind(config: &FaultConfig) -> FaultKind {
    match config.kind {
        FaultKindConfig::Corrupt => FaultKind::Corrupt,
        FaultKindConfig::Delay => {
            FaultKind::Delay { by_ns: (config.size_si() * SECOND_NS as f64).round() as u64 }
        }
        FaultKindConfig::Duplicate => FaultKind::Duplicate,
        FaultKindConfig::Babble => {
            let (id, data) = (standard(config.id.unwrap_or(BABBLE_ID)), config.data.as_deref());
            let frame = Frame::new(id, data.unwrap_or(&BABBLE_DATA)).expect("at most 8 bytes");
            FaultKind::Babble { frame }
        }
        FaultKindConfig::Disconnect => FaultKind::Disconnect,
        FaultKindConfig::BusOff => FaultKind::BusOff,
        // The other kinds have no bus.
        _ => FaultKind::Lose,
    }
}

fn standard(id: u16) -> CanId {
    CanId::standard(id & 0x7FF).expect("11 bits")
}

fn port_of(config: &FaultConfig, nodes: &[NodeId]) -> Result<Option<usize>, PlantError> {
    let Some(node) = config.node else { return Ok(None) };
    if let Some(port) = nodes.iter().position(|id| id.get() == node) {
        return Ok(Some(port));
    }
    let present = nodes.iter().map(|id| id.get().to_string()).collect::<Vec<_>>().join(", ");
    let bus = config.bus.unwrap_or_default();
    Err(PlantError::Scenario(format!("faults.node = {node}: bus {bus} has the nodes {present}")))
}
