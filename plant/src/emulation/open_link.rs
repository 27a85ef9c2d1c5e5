//! The emulated drives on simulated wires without a master, for foreign masters and other nodes.

use masseter_can::Bus;
use masseter_shared::config::Scenario;

use super::virtual_link::VirtualLink;
use crate::error::PlantError;
use crate::link::Link;

/// Drives, mechanism and wires with free ports for other nodes.
#[derive(Debug)]
pub struct OpenLink {
    link: VirtualLink,
    /// Free ports of each bus.
    free: Vec<Vec<usize>>,
}

/// The port of a foreign node on a bus.
#[derive(Debug, PartialEq, Eq)]
pub struct NodePort {
    bus: usize,
    port: usize,
}

impl OpenLink {
    /// The scenario's drives, switched on at `now_ns`, with this many free ports on each bus.
    pub fn new(scenario: &Scenario, others: usize, now_ns: u64) -> Result<Self, PlantError> {
        let link = VirtualLink::new(scenario, others, now_ns)?;
        let ports = |axes: &Vec<usize>| (1 + axes.len()..1 + axes.len() + others).rev().collect();
        Ok(Self { link, free: scenario.can.buses.iter().map(ports).collect() })
    }

    /// Number of buses.
    pub fn buses(&self) -> usize {
        self.free.len()
    }

    /// Simulates everything up to `now_ns`.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), PlantError> {
        Ok(self.link.advance(now_ns)?)
    }

    /// Takes a free port of a bus; none when there is no such bus or no free port.
    pub fn connect(&mut self, bus: usize) -> Option<NodePort> {
        let port = self.free.get_mut(bus)?.pop()?;
        // Frames that the port received while it was free are discarded.
        while !matches!(self.link.port_at(bus, port).receive(u64::MAX), Ok(None)) {}
        Some(NodePort { bus, port })
    }

    /// Frees a port.
    pub fn disconnect(&mut self, NodePort { bus, port }: NodePort) {
        self.free[bus].push(port);
    }

    /// A foreign node's access to its bus.
    pub fn port(&mut self, node: &NodePort) -> impl Bus {
        self.link.port_at(node.bus, node.port)
    }
}
