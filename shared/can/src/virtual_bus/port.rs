//! One port of a virtual wire as a [`Bus`].

use super::queue::Queued;
use super::wire::VirtualWire;
use crate::bus::{Bus, BusStatus, ErrorState, ReceiveError, Received, SendError};
use crate::faults::NumberedFrame;
use crate::frame::Frame;

/// A port, borrowed from its wire for as long as it is used.
///
/// A port does not move time: frames arrive when the caller [advances](VirtualWire::advance) the wire.
#[derive(Debug)]
pub struct Port<'a> {
    wire: &'a mut VirtualWire,
    port: usize,
}

impl VirtualWire {
    /// One port, to be used as a [`Bus`].
    ///
    /// # Panics
    /// If no port has that index.
    pub fn port(&mut self, port: usize) -> Port<'_> {
        let ports = self.nodes.stations.len();
        assert!(port < ports, "port {port} of a wire with {ports}");
        Port { wire: self, port }
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
    /// [`ReceiveError::Overrun`] where frames were lost because the port's queue was full; no other.
    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.wire.nodes.stations[self.port].receive.pop(now_ns)
    }

    fn status(&self) -> BusStatus {
        self.wire.nodes.stations[self.port].confinement.status()
    }
}
