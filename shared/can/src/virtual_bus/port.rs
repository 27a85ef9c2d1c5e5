//! One port of a virtual wire as a [`Bus`].

use super::VirtualWire;
use crate::bus::{Bus, BusStatus, ReceiveError, Received, SendError};
use crate::frame::Frame;

/// A port, borrowed from its wire for as long as it is used.
///
/// It does not move time: somebody has to [`advance`](VirtualWire::advance) the wire for frames to arrive.
#[derive(Debug)]
pub struct Port<'a> {
    wire: &'a mut VirtualWire,
    port: usize,
}

impl<'a> Port<'a> {
    pub(super) fn new(wire: &'a mut VirtualWire, port: usize) -> Self {
        assert!(port < wire.stations.len(), "port {port} of a wire with {}", wire.stations.len());
        Self { wire, port }
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
