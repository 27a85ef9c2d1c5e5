//! A simulated wire: bit-exact frame times, arbitration, bounded queues, all in virtual time.
//!
//! A frame takes the time of its exact stuffed length. Whenever the bus gets idle, the lowest identifier
//! among all ports' most urgent frames wins. Every other port and the tap receive the frame when its last
//! end-of-frame bit is over, which is its time stamp; three bits of interframe space later the bus is
//! idle again.
//!
//! # Time
//! The wire moves in [`advance`](VirtualWire::advance) only. All frames queued at or before an instant take
//! part in the arbitration of that instant, in whatever order they were queued: the frame that starts at
//! `t` is settled once the wire advances beyond `t`. A frame queued for a time before the one already
//! advanced to counts as queued at that time.
//!
//! # What is not modelled
//! Bit errors, error frames, retransmission and error counters: every port stays error active with both
//! counters 0. Missing acknowledgement: a lone port sends successfully. Two ports that arbitrate with the
//! same identifier destroy each other's frame on a real wire unless they are bit for bit the same; here the
//! lower port goes first, the other follows, and the collision is counted. A run with collisions is that
//! of a misconfigured bus.

mod port;
mod queue;
mod statistics;
#[cfg(test)]
mod tests;

use super::bus::{ReceiveError, Received, SendError};
use super::frame::Frame;
use super::wire::{Bitrate, INTERFRAME_BITS, wire_bits};
use queue::{Queued, ReceiveQueue, TransmitQueue};

pub use port::Port;
pub use statistics::Statistics;

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
}

/// A simulated wire and the ports on it.
#[derive(Debug)]
pub struct VirtualWire {
    bitrate: Bitrate,
    ports: Vec<PortQueues>,
    tap: ReceiveQueue,
    in_flight: Option<Flight>,
    idle_from_ns: u64,
    advanced_to_ns: u64,
    statistics: Statistics,
}

#[derive(Debug)]
struct PortQueues {
    transmit: TransmitQueue,
    receive: ReceiveQueue,
}

/// A frame on the wire.
#[derive(Debug, Clone, Copy)]
struct Flight {
    sender: usize,
    frame: Frame,
    queued_ns: u64,
    bits: u32,
    start_ns: u64,
    end_ns: u64,
}

impl VirtualWire {
    /// An idle wire at time 0. Nothing is allocated after this.
    pub fn new(config: &WireConfig) -> Self {
        let queues = || PortQueues {
            transmit: TransmitQueue::new(config.transmit_capacity),
            receive: ReceiveQueue::new(config.receive_capacity),
        };
        Self {
            bitrate: config.bitrate,
            ports: (0..config.ports).map(|_| queues()).collect(),
            tap: ReceiveQueue::new(config.receive_capacity * config.ports),
            in_flight: None,
            idle_from_ns: 0,
            advanced_to_ns: 0,
            statistics: Statistics::default(),
        }
    }

    /// One port, to be used as a [`Bus`](super::Bus).
    ///
    /// # Panics
    /// As all methods that take a port: if there is none of that index.
    pub fn port(&mut self, port: usize) -> Port<'_> {
        Port::new(self, port)
    }

    /// Queues a frame at a port.
    ///
    /// # Errors
    /// [`SendError::QueueFull`]; no other.
    pub fn send(&mut self, port: usize, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        let queued_ns = now_ns.max(self.advanced_to_ns);
        self.ports[port].transmit.push(Queued { frame, bits: wire_bits(&frame), since_ns: queued_ns })
    }

    /// The next frame that a port had received at `now_ns`.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] where frames were lost because the port's queue was full; no other.
    pub fn receive(&mut self, port: usize, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.ports[port].receive.pop(now_ns)
    }

    /// The next frame that was on the wire up to `now_ns`, whoever sent it.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] where the tap missed frames because nobody fetched them; no other.
    pub fn tap(&mut self, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.tap.pop(now_ns)
    }

    /// When the next frame will have arrived, if nothing else is queued until then, ns; `None` when nothing
    /// is on the way.
    pub fn next_event_ns(&self) -> Option<u64> {
        let flight = self.in_flight.or_else(|| self.arbitrate(self.next_start_ns()?));
        flight.map(|flight| flight.end_ns)
    }

    /// Lets time pass: all arbitrations before `until_ns` and all arrivals up to and including it, in the
    /// order of time. A time already passed changes nothing.
    pub fn advance(&mut self, until_ns: u64) {
        while self.start_before(until_ns) && self.arrive_until(until_ns) {}
        self.advanced_to_ns = self.advanced_to_ns.max(until_ns);
    }

    /// What happened on the wire so far, up to the last frame that arrived.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Puts the next frame on the wire if it starts before `until_ns`; whether one is on it now.
    fn start_before(&mut self, until_ns: u64) -> bool {
        if self.in_flight.is_none() {
            let start_ns = self.next_start_ns().filter(|&start_ns| start_ns < until_ns);
            if let Some(flight) = start_ns.and_then(|start_ns| self.arbitrate(start_ns)) {
                self.statistics.collisions += self.collides(&flight) as u64;
                self.ports[flight.sender].transmit.remove_most_urgent(flight.start_ns);
                self.in_flight = Some(flight);
            }
        }
        self.in_flight.is_some()
    }

    /// Delivers the frame on the wire if it arrives up to `until_ns`; whether it did.
    fn arrive_until(&mut self, until_ns: u64) -> bool {
        let Some(flight) = self.in_flight.take_if(|flight| flight.end_ns <= until_ns) else { return false };
        self.deliver(&flight);
        self.idle_from_ns = flight.start_ns + self.bitrate.bits_to_ns(flight.bits);
        self.statistics.count(
            flight.bits,
            self.idle_from_ns - flight.start_ns,
            flight.end_ns - flight.queued_ns,
        );
        true
    }

    fn deliver(&mut self, flight: &Flight) {
        let received = Received { frame: flight.frame, time_ns: flight.end_ns };
        self.tap.push(received);
        let others = self.ports.iter_mut().enumerate().filter(|(port, _)| *port != flight.sender);
        others.for_each(|(_, queues)| queues.receive.push(received));
    }

    /// When the next arbitration takes place: as soon as the bus is idle and something is queued.
    fn next_start_ns(&self) -> Option<u64> {
        let queued_ns = self.ports.iter().filter_map(|queues| queues.transmit.earliest_ns()).min()?;
        Some(queued_ns.max(self.idle_from_ns))
    }

    /// The winner of the arbitration at that time: lowest identifier, then lowest port.
    fn arbitrate(&self, start_ns: u64) -> Option<Flight> {
        let heads = self.ports.iter().enumerate();
        let heads = heads.filter_map(|(port, queues)| Some((port, queues.transmit.most_urgent(start_ns)?)));
        let (sender, Queued { frame, bits, since_ns: queued_ns }) =
            heads.min_by_key(|(_, head)| head.frame.id())?;
        let end_ns = start_ns + self.bitrate.bits_to_ns(bits - INTERFRAME_BITS);
        Some(Flight { sender, frame, queued_ns, bits, start_ns, end_ns })
    }

    /// Whether another port arbitrates with the same identifier as the winner.
    fn collides(&self, winner: &Flight) -> bool {
        self.ports.iter().enumerate().any(|(port, queues)| {
            let head = queues.transmit.most_urgent(winner.start_ns);
            port != winner.sender && head.is_some_and(|head| head.frame.id() == winner.frame.id())
        })
    }
}
