//! The emulated drives and their mechanism on simulated buses, without a master: what a foreign master
//! meets.

use masseter_can::Bus;
use masseter_shared::config::Scenario;

use crate::build::build_virtual;
use crate::error::PlantError;
use crate::link::{Link, VirtualLink};

/// Drives, mechanism, buses, and ports for others.
#[derive(Debug)]
pub struct OpenLink {
    link: VirtualLink,
    /// Free ports of each bus.
    free: Vec<Vec<usize>>,
}

/// A node of somebody else on a bus.
#[derive(Debug, PartialEq, Eq)]
pub struct NodePort {
    bus: usize,
    port: usize,
}

impl OpenLink {
    /// The scenario's drives, switched on at `now_ns`, and room for so many other nodes on each bus.
    pub fn new(scenario: &Scenario, others: usize, now_ns: u64) -> Result<Self, PlantError> {
        let link = build_virtual(scenario, others, now_ns)?;
        let ports = |axes: &Vec<usize>| (1 + axes.len()..1 + axes.len() + others).rev().collect();
        Ok(Self { link, free: scenario.can.buses.iter().map(ports).collect() })
    }

    /// Buses.
    pub fn buses(&self) -> usize {
        self.free.len()
    }

    /// Lets everything happen that happens up to `now_ns`.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), PlantError> {
        Ok(self.link.advance(now_ns)?)
    }

    /// A place on a bus; none when there is no such bus or no room on it.
    pub fn connect(&mut self, bus: usize) -> Option<NodePort> {
        let port = self.free.get_mut(bus)?.pop()?;
        // What the place heard while it was free is of no interest.
        while !matches!(self.link.port_at(bus, port).receive(u64::MAX), Ok(None)) {}
        Some(NodePort { bus, port })
    }

    /// Gives a place back.
    pub fn disconnect(&mut self, NodePort { bus, port }: NodePort) {
        self.free[bus].push(port);
    }

    /// A place as a port onto its bus.
    pub fn port(&mut self, node: &NodePort) -> impl Bus {
        self.link.port_at(node.bus, node.port)
    }
}
