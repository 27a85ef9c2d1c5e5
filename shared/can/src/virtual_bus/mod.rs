//! A simulated wire: bit-exact frame times, arbitration, errors and fault confinement, bounded queues, all in
//! virtual time.
//!
//! A frame takes the time of its exact stuffed length. When the bus gets idle, the lowest identifier among all ports'
//! most urgent frames wins. Every other port and the tap receive the frame at the end of its last end-of-frame bit,
//! which is its time stamp. Three bits of interframe space later the bus is idle again.
//!
//! # Errors
//! A disturbance ends a frame. An error flag (6 bits, 12 with the echo of error active nodes), 8 bits of delimiter and
//! 3 of intermission follow. Then the transmitter takes part in the next arbitration with the same frame. A missing
//! acknowledgement is a disturbance, too. Two ports that send different frames of one identifier disturb each other
//! where the frames first differ; equal frames pass as one. Each port counts errors by the rules of ISO 11898-1,
//! becomes error passive and leaves the bus; a passive transmitter pauses for 8 bits. A port off the bus discards its
//! queue. After a restart it comes back with 128 times 11 recessive bits. The restart follows after
//! [`restart_after_ns`](WireConfig::restart_after_ns), as with `ip link … restart-ms`.
//!
//! # Time
//! The wire moves in [`advance`](VirtualWire::advance) only. All frames queued at or before an instant take part in the
//! arbitration of that instant, in any order of queueing. The frame that starts at `t` is final once the wire advances
//! beyond `t`. A frame queued for a time that the wire has passed counts as queued at the wire's present time. Faults
//! of nodes take effect between frames.
//!
//! # What is not modelled
//! - Errors that only some nodes see, and overload frames.
//! - The traffic of a disconnected node on its end of the wire.

use std::ops::Range;

use crate::faults::{FaultActivation, FaultNote, Faults, NumberedFrame};
use crate::{Bus, BusStatus, ErrorState, Frame, ReceiveError, Received, SendError, Tapped};

mod controller;
mod nodes;
#[cfg(test)]
mod tests;

use controller::{Confinement, Queued, SEQUENCE_BITS};
pub use nodes::WireConfig;
use nodes::{Nodes, PortSet, Station, Transmission};

/// A simulated wire and the ports on it.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct VirtualWire {
    nodes: Nodes,
    traffic: Traffic,
    advanced_to_ns: u64,
    /// Frames that ports took for transmission. Faults select the frames to delay by this number.
    queued: u64,
}

/// A port, borrowed from its wire.
///
/// A port does not move time: frames arrive when the caller [advances](VirtualWire::advance) the wire.
#[derive(Debug)]
pub struct Port<'a> {
    wire: &'a mut VirtualWire,
    port: usize,
}

/// The present or next transmission.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
enum Traffic {
    /// The wire is idle, and the next transmission is not computed yet.
    Unknown,
    /// The wire is idle, and no node has a frame to send.
    Nothing,
    /// The present transmission, or the next; until its start the wire is idle.
    Coming { transmission: Transmission, is_on_wire: bool },
}

/// A node leaves the bus by a fault, or comes back.
#[derive(Debug, Clone, Copy)]
struct NodeChange {
    at_ns: u64,
    port: usize,
    bus_off: Option<FaultActivation>,
}

impl VirtualWire {
    /// An idle wire at time 0. The wire allocates nothing later.
    pub fn new(config: &WireConfig) -> Self {
        Self::with_faults(config, Faults::default())
    }

    /// An idle wire with these faults.
    ///
    /// # Panics
    /// With more than 128 ports.
    pub fn with_faults(config: &WireConfig, faults: Faults) -> Self {
        assert!(config.ports <= PortSet::CAPACITY, "{} ports", config.ports);
        Self { nodes: Nodes::new(config, faults), traffic: Traffic::Unknown, advanced_to_ns: 0, queued: 0 }
    }

    /// One port, as a [`Bus`].
    ///
    /// # Panics
    /// If no port has that index.
    pub fn port(&mut self, port: usize) -> Port<'_> {
        let ports = self.nodes.stations.len();
        assert!(port < ports, "port {port} of a wire with {ports}");
        Port { wire: self, port }
    }

    /// The next frame or error on the wire up to `now_ns`, of any port.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] for frames lost in a full queue of the tap; no other.
    pub fn tap(&mut self, now_ns: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.nodes.tap.pop(now_ns)
    }

    /// The next note on the wire's faults up to `now_ns`.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.nodes.faults.next_note(now_ns)
    }

    /// Sets the time of a fault, from now on at the earliest: the wire's past stays. A number of no fault has no
    /// effect.
    pub fn set_fault_window(&mut self, number: usize, window_ns: Range<u64>) {
        let from_ns = window_ns.start.max(self.advanced_to_ns);
        self.nodes.faults.set_window(number, from_ns..window_ns.end);
        self.invalidate_traffic();
    }

    /// End of the frame on the wire or of the next frame, ns, if no other frame is queued until then. `None` without a
    /// frame.
    pub fn next_event_ns(&mut self) -> Option<u64> {
        self.update_traffic();
        match &self.traffic {
            Traffic::Coming { transmission, .. } => Some(transmission.end_ns),
            Traffic::Nothing | Traffic::Unknown => None,
        }
    }

    /// Lets time pass: all arbitrations before `until_ns` and all endings up to and including it, in the
    /// order of time. A time already passed changes nothing.
    pub fn advance(&mut self, until_ns: u64) {
        while self.start_before(until_ns) && self.end_until(until_ns) {}
        self.advanced_to_ns = self.advanced_to_ns.max(until_ns);
    }

    /// Puts the next frame on the wire if the frame starts before `until_ns`. Returns whether a frame is on the wire.
    /// Until then nodes go to bus-off or come back.
    fn start_before(&mut self, until_ns: u64) -> bool {
        if self.is_busy() {
            return true;
        }
        // No frame starts before the bus is idle, and a result now would miss the answers of the receivers.
        if self.nodes.idle_from_ns > until_ns {
            return false;
        }
        loop {
            self.update_traffic();
            let idle_until_ns = match &self.traffic {
                Traffic::Coming { transmission, .. } => transmission.start_ns.min(until_ns),
                _ => until_ns,
            };
            if self.has_node_changes() {
                let sequence_ns = self.nodes.config.bitrate.bits_to_ns(SEQUENCE_BITS);
                let change = self.next_node_change(sequence_ns);
                if let Some(change) = change.filter(|change| change.at_ns <= idle_until_ns) {
                    self.apply_change(change);
                    continue;
                }
                for station in &mut self.nodes.stations {
                    station.confinement.saw_idle(idle_until_ns, sequence_ns);
                }
                self.nodes.faults.begin_disconnections(idle_until_ns);
            }
            return match &mut self.traffic {
                Traffic::Coming { transmission, is_on_wire } if transmission.start_ns < until_ns => {
                    self.nodes.transmissions += 1;
                    *is_on_wire = true;
                    true
                }
                _ => false,
            };
        }
    }

    /// Computes the next transmission, unless known: callers ask far more often than the state changes.
    #[inline]
    fn update_traffic(&mut self) {
        if let Traffic::Unknown = self.traffic {
            self.traffic = match self.nodes.next_transmission() {
                Some(transmission) => Traffic::Coming { transmission, is_on_wire: false },
                None => Traffic::Nothing,
            };
        }
    }

    /// Discards the computed next transmission after a change. A transmission on the wire stays.
    fn invalidate_traffic(&mut self) {
        if !self.is_busy() {
            self.traffic = Traffic::Unknown;
        }
    }

    /// Ends the frame on the wire if its end is not after `until_ns`, and returns whether the frame has ended.
    fn end_until(&mut self, until_ns: u64) -> bool {
        match self.traffic {
            Traffic::Coming { transmission, is_on_wire: true } if transmission.end_ns <= until_ns => {
                self.traffic = Traffic::Unknown;
                self.nodes.end_transmission(&transmission);
                true
            }
            _ => false,
        }
    }

    fn is_busy(&self) -> bool {
        matches!(self.traffic, Traffic::Coming { is_on_wire: true, .. })
    }

    /// Whether a node may leave the bus or come back while the wire is idle.
    fn has_node_changes(&self) -> bool {
        !self.nodes.faults.is_empty()
            || self.nodes.stations.iter().any(|station| station.confinement.is_off())
    }

    /// The next change of a node while the wire stays idle.
    fn next_node_change(&self, sequence_ns: u64) -> Option<NodeChange> {
        let idle_from_ns = self.nodes.idle_from_ns;
        let change = |(port, station): (usize, &Station)| {
            if let Some(at_ns) = station.confinement.back_at_ns(sequence_ns) {
                return Some(NodeChange { at_ns: at_ns.max(idle_from_ns), port, bus_off: None });
            }
            if station.confinement.is_off() {
                return None;
            }
            let from_ns = station.on_bus_from_ns.max(idle_from_ns);
            let activation = self.nodes.faults.next_bus_off(from_ns, port)?;
            Some(NodeChange { at_ns: activation.at_ns, port, bus_off: Some(activation) })
        };
        let changes = self.nodes.stations.iter().enumerate().filter_map(change);
        changes.min_by_key(|change| change.at_ns)
    }

    fn apply_change(&mut self, NodeChange { at_ns, port, bus_off }: NodeChange) {
        if let Some(activation) = bus_off {
            self.nodes.faults.record(activation);
            let restart_after_ns = self.nodes.config.restart_after_ns;
            self.nodes.confine(port, at_ns, |node| node.leave_bus(at_ns, restart_after_ns));
        } else {
            self.nodes.stations[port].on_bus_from_ns = at_ns;
            self.nodes.confine(port, at_ns, Confinement::come_back);
        }
        self.invalidate_traffic();
    }
}

impl Bus for Port<'_> {
    /// # Errors
    /// [`SendError::QueueFull`] and [`SendError::BusOff`]; no other.
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        let VirtualWire { nodes, queued: number, advanced_to_ns, .. } = self.wire;
        let station = &mut nodes.stations[self.port];
        let status = station.confinement.status();
        if status.state == ErrorState::BusOff {
            return Err(SendError::BusOff { tec: status.tec });
        }
        let numbered = NumberedFrame { at_ns: now_ns, port: self.port, id: frame.id(), number: *number };
        let delay = nodes.faults.delays(numbered);
        let queued_ns = now_ns.max(*advanced_to_ns) + delay.map_or(0, |(_, by_ns)| by_ns);
        station.transmit.push(Queued::new(frame, nodes.config.bitrate, queued_ns))?;
        if let Some((activation, _)) = delay {
            nodes.faults.record(activation);
        }
        *number += 1;
        self.wire.invalidate_traffic();
        Ok(())
    }

    /// # Errors
    /// [`ReceiveError::Overrun`] for frames lost in a full queue of the port; no other.
    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.wire.nodes.stations[self.port].receive.pop(now_ns)
    }

    fn status(&self) -> BusStatus {
        self.wire.nodes.stations[self.port].confinement.status()
    }

    fn unsent(&self) -> usize {
        self.wire.nodes.stations[self.port].transmit.frames.len()
    }
}
