//! The nodes of a simulated wire, and everything else that decides about the next transmission.

use super::confinement::Confinement;
use super::queue::{ReceiveQueue, TransmitQueue};
use crate::bus::Received;
use crate::faults::Faults;
use crate::wire::{Bitrate, INTERFRAME_BITS};

/// What a wire is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WireConfig {
    /// Bit rate.
    pub bitrate: Bitrate,
    /// Ports, one a node.
    pub ports: usize,
    /// Frames a port may have waiting for transmission.
    pub transmit_capacity: usize,
    /// Frames a port may have received and not fetched; the tap's queue is as long for each port.
    pub receive_capacity: usize,
    /// How long after bus-off a port restarts by itself, ns; `None` for never.
    pub restart_after_ns: Option<u64>,
}

/// A port with its controller.
#[derive(Debug)]
pub(super) struct Station {
    pub(super) transmit: TransmitQueue,
    pub(super) receive: ReceiveQueue<Received>,
    pub(super) confinement: Confinement,
    /// The time from which the node takes part on the bus, ns.
    pub(super) on_bus_from_ns: u64,
    /// A passive transmitter sends nothing before this time, ns.
    pub(super) suspended_until_ns: u64,
}

/// All nodes, their faults and the state of the wire between them.
#[derive(Debug)]
pub(super) struct Nodes {
    pub(super) config: WireConfig,
    pub(super) stations: Vec<Station>,
    pub(super) faults: Faults,
    /// Transmissions so far. Faults select transmissions by this number.
    pub(super) transmissions: u64,
    pub(super) idle_from_ns: u64,
    /// Duration of the interframe space, ns.
    pub(super) interframe_ns: u64,
}

impl Nodes {
    pub(super) fn new(config: &WireConfig, faults: Faults) -> Self {
        let station = || Station {
            transmit: TransmitQueue::new(config.transmit_capacity),
            receive: ReceiveQueue::new(config.receive_capacity),
            confinement: Confinement::new(),
            on_bus_from_ns: 0,
            suspended_until_ns: 0,
        };
        Self {
            config: *config,
            stations: (0..config.ports).map(|_| station()).collect(),
            faults,
            transmissions: 0,
            idle_from_ns: 0,
            interframe_ns: config.bitrate.bits_to_ns(INTERFRAME_BITS),
        }
    }

    /// Whether a port takes part in the traffic.
    pub(super) fn is_on_bus(&self, port: usize, now_ns: u64) -> bool {
        !self.stations[port].confinement.is_off() && !self.faults.is_disconnected(now_ns, port)
    }
}
