//! A simulated wire: bit-exact frame times, arbitration, errors and fault confinement, bounded queues, all in
//! virtual time.
//!
//! A frame takes the time of its exact stuffed length. Whenever the bus gets idle, the lowest identifier
//! among all ports' most urgent frames wins. Every other port and the tap receive the frame when its last
//! end-of-frame bit is over, which is its time stamp; three bits of interframe space later the bus is
//! idle again.
//!
//! # Errors
//! A frame that is disturbed ends where the disturbance is: an error flag (6 bits, 12 where error active
//! nodes echo it), 8 bits of delimiter, 3 of intermission; then the transmitter takes part in the next
//! arbitration with the same frame. Nobody to acknowledge is such a disturbance. Two ports that send different
//! frames of one identifier disturb each other where the frames first differ; equal frames pass as one. Each
//! port counts errors as ISO 11898-1 has it, becomes error passive and goes off the bus; a passive
//! transmitter pauses for 8 bits. A port off the bus forgets what it had queued, and comes back with 128
//! times 11 recessive bits once it is restarted: by [`restart`](VirtualWire::restart), or by itself after
//! [`restart_after_ns`](WireConfig::restart_after_ns), as `ip link … restart-ms` has it.
//!
//! # Time
//! The wire moves in [`advance`](VirtualWire::advance) only. All frames queued at or before an instant take
//! part in the arbitration of that instant, in whatever order they were queued: the frame that starts at
//! `t` is settled once the wire advances beyond `t`. A frame queued for a time before the one already
//! advanced to counts as queued at that time. Faults of nodes take effect between frames.
//!
//! # What is not modelled
//! Errors seen by some nodes only, overload frames, what a disconnected node does on its end of the wire, and the
//! recessive ESI bit of an error passive node's FD frames, which may change their stuffing.

mod attempt;
mod confinement;
mod ending;
mod port;
mod queue;
mod statistics;
#[cfg(test)]
mod tests;

use super::bus::{BusStatus, ErrorState, ReceiveError, Received, SendError};
use super::error_frame::ErrorReport;
use super::faults::{FaultNote, Faults, NumberedFrame, Strike};
use super::frame::{Frame, FrameFormat};
use super::tap::Tapped;
use super::wire::{INTERFRAME_BITS, Rates};
use attempt::{Attempt, PortSet};
use confinement::{Confinement, SEQUENCE_BITS};
use queue::{Queued, ReceiveQueue, TransmitQueue};

pub use port::Port;
pub use statistics::Statistics;

/// What a wire is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct WireConfig {
    /// Bit rates.
    pub rates: Rates,
    /// The format in which every port sends.
    pub format: FrameFormat,
    /// Ports, one a node.
    pub ports: usize,
    /// Frames a port may have waiting for transmission.
    pub transmit_capacity: usize,
    /// Frames a port may have received and not fetched; the tap's queue is as long for each port.
    pub receive_capacity: usize,
    /// How long after bus-off a port restarts by itself, ns; `None` when it waits to be restarted.
    pub restart_after_ns: Option<u64>,
}

/// A simulated wire and the ports on it.
#[derive(Debug)]
pub struct VirtualWire {
    config: WireConfig,
    stations: Vec<Station>,
    tap: ReceiveQueue<Tapped>,
    faults: Faults,
    /// What babbling nodes send, by fault.
    babble: Vec<Option<Queued>>,
    traffic: Traffic,
    /// Attempts so far: the number by which faults choose among them.
    attempts: u64,
    idle_from_ns: u64,
    advanced_to_ns: u64,
    /// Between two frames.
    interframe_ns: u64,
    statistics: Statistics,
}

/// What is, or will next be, on the wire.
#[derive(Debug)]
enum Traffic {
    /// The wire is idle, and what comes next was not asked since something changed.
    Unforeseen,
    /// The wire is idle, and nobody has anything to send.
    Nothing,
    /// That is on the wire, or will be; until then the wire is idle.
    Coming { attempt: Attempt, is_on_wire: bool },
}

/// A port with its controller.
#[derive(Debug)]
struct Station {
    transmit: TransmitQueue,
    receive: ReceiveQueue<Received>,
    confinement: Confinement,
    /// Since when it takes part on the bus.
    on_bus_from_ns: u64,
    /// Until when a passive transmitter keeps from sending again.
    suspended_until_ns: u64,
}

/// A node goes off the bus by a fault, or comes back.
#[derive(Debug, Clone, Copy)]
struct NodeChange {
    at_ns: u64,
    port: usize,
    bus_off: Option<Strike>,
}

impl VirtualWire {
    /// An idle wire at time 0. Nothing is allocated after this.
    pub fn new(config: &WireConfig) -> Self {
        Self::with_faults(config, Faults::default())
    }

    /// An idle wire that these faults befall.
    ///
    /// # Panics
    /// With more than 64 ports.
    pub fn with_faults(config: &WireConfig, faults: Faults) -> Self {
        assert!(config.ports <= PortSet::CAPACITY, "{} ports", config.ports);
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
            tap: ReceiveQueue::new(config.receive_capacity * config.ports),
            babble: faults.babbled().map(|frame| Some(Queued::babbled(frame?, config))).collect(),
            faults,
            traffic: Traffic::Unforeseen,
            attempts: 0,
            idle_from_ns: 0,
            advanced_to_ns: 0,
            interframe_ns: config.rates.nominal().bits_to_ns(INTERFRAME_BITS),
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
    /// [`SendError::QueueFull`], [`SendError::BusOff`] and [`SendError::NotFd`]; no other.
    pub fn send(&mut self, port: usize, now_ns: u64, frame: Frame) -> Result<(), SendError> {
        let status = self.stations[port].confinement.status();
        if status.state == ErrorState::BusOff {
            return Err(SendError::BusOff { tec: status.tec });
        }
        let frame = frame.promoted(self.config.format);
        if frame.format().is_fd() && !self.config.format.is_fd() {
            return Err(SendError::NotFd { length: frame.data().len() });
        }
        let number = self.statistics.queued;
        let delay = self.faults.delays(NumberedFrame { at_ns: now_ns, port, id: frame.id(), number });
        let queued_ns = now_ns.max(self.advanced_to_ns) + delay.map_or(0, |(_, by_ns)| by_ns);
        self.stations[port].transmit.push(Queued::new(frame, self.config.rates, queued_ns))?;
        if let Some((strike, _)) = delay {
            self.faults.record(strike);
        }
        self.look_again();
        self.statistics.queued += 1;
        Ok(())
    }

    /// The next frame that a port had received at `now_ns`.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] where frames were lost because the port's queue was full; no other.
    pub fn receive(&mut self, port: usize, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.stations[port].receive.pop(now_ns)
    }

    /// The next frame or error that was on the wire up to `now_ns`, whoever caused it.
    ///
    /// # Errors
    /// [`ReceiveError::Overrun`] where the tap missed frames because nobody fetched them; no other.
    pub fn tap(&mut self, now_ns: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.tap.pop(now_ns)
    }

    /// What is to be told of the wire's faults up to `now_ns`.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.faults.next_note(now_ns)
    }

    /// Fault confinement of a port.
    pub fn status(&self, port: usize) -> BusStatus {
        self.stations[port].confinement.status()
    }

    /// Restarts the controller of a port that is off the bus, as its host does; no effect on others.
    pub fn restart(&mut self, port: usize, now_ns: u64) {
        self.stations[port].confinement.restart(now_ns.max(self.advanced_to_ns));
        self.look_again();
    }

    /// When the frame on the wire, or the next one, will have ended if nothing else is queued until then,
    /// ns; `None` when nothing is on the way.
    pub fn next_event_ns(&mut self) -> Option<u64> {
        self.foresee();
        match &self.traffic {
            Traffic::Coming { attempt, .. } => Some(attempt.end_ns),
            Traffic::Nothing | Traffic::Unforeseen => None,
        }
    }

    /// Lets time pass: all arbitrations before `until_ns` and all endings up to and including it, in the
    /// order of time. A time already passed changes nothing.
    pub fn advance(&mut self, until_ns: u64) {
        while self.start_before(until_ns) && self.end_until(until_ns) {}
        self.advanced_to_ns = self.advanced_to_ns.max(until_ns);
    }

    /// What happened on the wire so far, up to the last frame that ended.
    pub fn statistics(&self) -> &Statistics {
        &self.statistics
    }

    /// Puts the next frame on the wire if it starts before `until_ns`; whether one is on it now. Until then
    /// nodes come back from bus-off, or are sent there.
    fn start_before(&mut self, until_ns: u64) -> bool {
        if self.is_busy() {
            return true;
        }
        // Behind a frame nothing can start yet, and what its receivers answer would have to be looked at again.
        if self.idle_from_ns > until_ns {
            return false;
        }
        loop {
            self.foresee();
            let idle_until_ns = match &self.traffic {
                Traffic::Coming { attempt, .. } => attempt.start_ns.min(until_ns),
                _ => until_ns,
            };
            if self.is_restless() {
                let sequence_ns = self.config.rates.nominal().bits_to_ns(SEQUENCE_BITS);
                let change = self.next_node_change(sequence_ns);
                if let Some(change) = change.filter(|change| change.at_ns <= idle_until_ns) {
                    self.apply(change);
                    continue;
                }
                self.stay_idle_until(idle_until_ns, sequence_ns);
            }
            return match &mut self.traffic {
                Traffic::Coming { attempt, is_on_wire } if attempt.start_ns < until_ns => {
                    self.attempts += 1;
                    *is_on_wire = true;
                    true
                }
                _ => false,
            };
        }
    }

    /// Finds out what comes next, unless that is known: it is asked for far more often than it changes.
    #[inline]
    fn foresee(&mut self) {
        if let Traffic::Unforeseen = self.traffic {
            self.traffic = self.foretell();
        }
    }

    /// Something changed that what comes next may depend on. What is on the wire stays there.
    fn look_again(&mut self) {
        if !self.is_busy() {
            self.traffic = Traffic::Unforeseen;
        }
    }

    /// Ends the frame on the wire if its end is not after `until_ns`; whether it did.
    fn end_until(&mut self, until_ns: u64) -> bool {
        match self.traffic {
            Traffic::Coming { attempt, is_on_wire: true } if attempt.end_ns <= until_ns => {
                self.traffic = Traffic::Unforeseen;
                self.end(&attempt);
                true
            }
            _ => false,
        }
    }

    fn is_busy(&self) -> bool {
        matches!(self.traffic, Traffic::Coming { is_on_wire: true, .. })
    }

    /// Whether a node may leave the bus or come back while the wire is idle.
    fn is_restless(&self) -> bool {
        let is_off = |station: &Station| station.confinement.state() == ErrorState::BusOff;
        !self.faults.is_empty() || self.stations.iter().any(is_off)
    }

    fn stay_idle_until(&mut self, until_ns: u64, sequence_ns: u64) {
        for station in &mut self.stations {
            station.confinement.saw_idle(until_ns, sequence_ns);
        }
        self.faults.begin_disconnections(until_ns);
    }

    /// What next happens to a node while the wire stays idle.
    fn next_node_change(&self, sequence_ns: u64) -> Option<NodeChange> {
        let change = |port: usize, station: &Station| {
            if let Some(at_ns) = station.confinement.back_at_ns(sequence_ns) {
                return Some(NodeChange { at_ns: at_ns.max(self.idle_from_ns), port, bus_off: None });
            }
            if station.confinement.state() == ErrorState::BusOff {
                return None;
            }
            let strike = self.faults.next_bus_off(station.on_bus_from_ns.max(self.idle_from_ns), port)?;
            Some(NodeChange { at_ns: strike.at_ns, port, bus_off: Some(strike) })
        };
        let changes = self.stations.iter().enumerate().filter_map(|(port, station)| change(port, station));
        changes.min_by_key(|change| change.at_ns)
    }

    fn apply(&mut self, NodeChange { at_ns, port, bus_off }: NodeChange) {
        if let Some(strike) = bus_off {
            self.faults.record(strike);
            let restart_after_ns = self.config.restart_after_ns;
            self.confine(port, at_ns, |node| node.leave_bus(at_ns, restart_after_ns));
        } else {
            self.stations[port].on_bus_from_ns = at_ns;
            self.confine(port, at_ns, Confinement::come_back);
        }
        self.look_again();
    }

    /// Changes a port's fault confinement; a change of its state is tapped, and who leaves the bus forgets
    /// what it had queued.
    fn confine(&mut self, port: usize, now_ns: u64, change: impl FnOnce(&mut Confinement)) {
        let station = &mut self.stations[port];
        let before = station.confinement.state();
        change(&mut station.confinement);
        let status = station.confinement.status();
        if status.state == before {
            return;
        }
        let kind = super::ErrorKind::State(status.state);
        self.tap.push(Tapped::Error(ErrorReport::new(now_ns, port as u8, kind, status)));
        if status.state == ErrorState::BusOff {
            self.statistics.bus_offs += 1;
            self.statistics.abandoned += station.transmit.clear();
        }
    }
}
