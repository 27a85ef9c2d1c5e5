//! Counters over a port.

use crate::can::bus::{Bus, BusStatus, ReceiveError, Received, SendError};
use crate::can::frame::Frame;

/// What went through a port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that the port took for transmission.
    pub sent: u64,
    /// Frames that it refused because its queue was full.
    pub refused: u64,
    /// Frames received.
    pub received: u64,
    /// Frames that arrived and were lost because nobody fetched them.
    pub lost: u64,
    /// Other failures of sending and receiving: bus-off, an interface that is down.
    pub failures: u64,
}

impl Counts {
    /// Counts what goes through that port.
    pub fn over<B: Bus>(&mut self, bus: B) -> Counted<'_, B> {
        Counted { counts: self, bus }
    }
}

/// A port whose traffic is counted.
#[derive(Debug)]
pub struct Counted<'a, B> {
    counts: &'a mut Counts,
    bus: B,
}

impl<B: Bus> Bus for Counted<'_, B> {
    fn send(&mut self, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        let result = self.bus.send(now_ns, frame);
        match result {
            Ok(()) => self.counts.sent += 1,
            Err(SendError::QueueFull { .. }) => self.counts.refused += 1,
            Err(_) => self.counts.failures += 1,
        }
        result
    }

    fn receive(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        let result = self.bus.receive(now_ns);
        match result {
            Ok(received) => self.counts.received += u64::from(received.is_some()),
            Err(ReceiveError::Overrun { lost }) => self.counts.lost += lost,
            Err(_) => self.counts.failures += 1,
        }
        result
    }

    fn status(&self) -> BusStatus {
        self.bus.status()
    }
}
