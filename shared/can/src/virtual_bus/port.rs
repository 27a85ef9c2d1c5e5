//! One port of a virtual wire as a [`Bus`].

use super::wire::VirtualWire;
use crate::bus::{Bus, BusStatus, ReceiveError, Received, SendError};
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
    /// As all methods that take a port: if no port has that index.
    pub fn port(&mut self, port: usize) -> Port<'_> {
        let ports = self.nodes.stations.len();
        assert!(port < ports, "port {port} of a wire with {ports}");
        Port { wire: self, port }
    }
}

impl Bus for Port<'_> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        self.wire.send(self.port, now_ns, frame)
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.wire.receive(self.port, now_ns)
    }

    fn status(&self) -> BusStatus {
        self.wire.status(self.port)
    }
}
