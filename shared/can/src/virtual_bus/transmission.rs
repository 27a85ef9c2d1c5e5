//! Arbitration: the next transmission and its outcome.
//!
//! Everything here is a function of the present state of the nodes, so a caller can ask for the next event without
//! changing the state.

use super::nodes::Nodes;
use super::queue::Queued;
use crate::bus::ErrorState;
use crate::error_frame::ErrorKind;
use crate::faults::{FaultActivation, NumberedFrame};
use crate::frame::Frame;
use crate::id::CanId;
use crate::wire::{BEHIND_ACKNOWLEDGE_BITS, INTERFRAME_BITS, first_difference, frame_bits};

const ERROR_FLAG_BITS: u32 = 6;
const ERROR_DELIMITER_BITS: u32 = 8;
/// A dominant bit behind the end of frame is answered one bit later by overload flags.
const LATE_FLAG_BITS: u32 = 7;

/// A set of ports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct PortSet(u64);

impl PortSet {
    /// Ports a wire may have.
    pub(super) const CAPACITY: usize = u64::BITS as usize;

    pub(super) fn contains(self, port: usize) -> bool {
        self.0 >> port & 1 == 1
    }

    fn add(&mut self, port: usize) {
        self.0 |= 1 << port;
    }

    /// The ports behind that one.
    fn above(self, port: usize) -> Self {
        Self(self.0 & (u64::MAX - 1) << port)
    }

    fn iter(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        std::iter::from_fn(move || {
            let port = rest.trailing_zeros() as usize;
            rest &= rest.wrapping_sub(1);
            (port < Self::CAPACITY).then_some(port)
        })
    }
}

/// A transmission of a frame, which stays queued until the transmission has ended.
#[derive(Debug, Clone, Copy)]
pub(super) struct Transmission {
    pub(super) frame: Frame,
    pub(super) queued_ns: u64,
    pub(super) start_ns: u64,
    /// When the last end-of-frame bit is, or would have been, over.
    pub(super) received_ns: u64,
    /// End of the frame, or of the delimiter of the error frame, ns.
    pub(super) end_ns: u64,
    /// When the next frame may start.
    pub(super) idle_from_ns: u64,
    pub(super) arbitration: ArbitrationResult,
    pub(super) outcome: TransmissionOutcome,
    pub(super) activation: Option<FaultActivation>,
}

/// How a transmission ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum TransmissionOutcome {
    /// All nodes receive the frame.
    Received,
    /// All nodes receive the frame, and the transmitter repeats it.
    ReceivedAndRepeated,
    /// An error frame ends the transmission.
    Destroyed(ErrorKind),
}

/// The frame that a port would send.
#[derive(Clone, Copy)]
struct Candidate {
    port: usize,
    queued: Queued,
    babbles: Option<FaultActivation>,
}

impl Candidate {
    fn id(&self) -> CanId {
        self.queued.frame.id()
    }
}

/// The arbitration among the nodes when the wire is next idle.
pub(super) struct Arbitration<'a> {
    pub(super) nodes: &'a Nodes,
}

impl Arbitration<'_> {
    /// The next transmission if no other frame is queued until then.
    pub(super) fn next_transmission(&self) -> Option<Transmission> {
        let ports = self.candidate_ports();
        // As soon as the bus is idle and a node has something to send.
        let start_ns = ports.iter().filter_map(|port| self.ready_ns(port)).min()?;
        let (arbitration, strongest) = self.arbitrate(ports, start_ns)?;
        let Queued { frame, duration_ns, since_ns: queued_ns } = strongest.queued;
        let numbered = NumberedFrame {
            at_ns: start_ns,
            port: strongest.port,
            id: frame.id(),
            number: self.nodes.transmissions,
        };
        let mut transmission = Transmission {
            frame,
            queued_ns,
            start_ns,
            received_ns: start_ns + duration_ns - self.nodes.interframe_ns,
            end_ns: start_ns + duration_ns - self.nodes.interframe_ns,
            idle_from_ns: start_ns + duration_ns,
            arbitration,
            outcome: TransmissionOutcome::Received,
            activation: strongest.babbles,
        };
        if let Some(bit) = arbitration.destroyed_at {
            transmission.destroy(self.nodes, bit, ErrorKind::Bit);
        } else if let Some(activation) = self.nodes.faults.corrupts(numbered) {
            let last = frame_bits(&frame) - INTERFRAME_BITS;
            let bit = 1 + self.nodes.faults.pick(activation, self.nodes.transmissions, last);
            transmission.activation = Some(activation);
            transmission.destroy(self.nodes, bit, ErrorKind::Bit);
        } else if !self.is_acknowledged(&transmission) {
            let slot = frame_bits(&frame) - INTERFRAME_BITS - BEHIND_ACKNOWLEDGE_BITS;
            transmission.destroy(self.nodes, slot, ErrorKind::Acknowledge);
        } else if let Some(activation) = self.nodes.faults.duplicates(numbered) {
            transmission.activation = Some(activation);
            transmission.repeat(self.nodes);
        }
        Some(transmission)
    }

    /// The ports that may have a frame to send, now or later.
    fn candidate_ports(&self) -> PortSet {
        let mut ports = PortSet::default();
        for (port, station) in self.nodes.stations.iter().enumerate() {
            // A node that babbles needs no queue.
            if !station.transmit.is_empty() || !self.nodes.faults.is_empty() {
                ports.add(port);
            }
        }
        ports
    }

    /// When a port can next take part in an arbitration, if at all.
    fn ready_ns(&self, port: usize) -> Option<u64> {
        let station = &self.nodes.stations[port];
        if station.confinement.is_off() {
            return None;
        }
        let may_ns = station.suspended_until_ns.max(station.on_bus_from_ns).max(self.nodes.idle_from_ns);
        let queued_ns = station.transmit.earliest_ns();
        let sends_ns =
            queued_ns.map(|since_ns| self.nodes.faults.connected_from_ns(may_ns.max(since_ns), port));
        let babbles_ns = self.nodes.faults.babbles_from_ns(may_ns, port);
        let at_ns = sends_ns.unwrap_or(u64::MAX).min(babbles_ns.unwrap_or(u64::MAX));
        (at_ns < u64::MAX).then_some(at_ns)
    }

    /// The frame that each of those ports would send at that time.
    fn candidates(&self, ports: PortSet, start_ns: u64) -> impl Iterator<Item = Candidate> {
        ports.iter().filter_map(move |port| {
            let candidate = self.candidate(port, start_ns)?;
            let may = self.nodes.stations[port].suspended_until_ns <= start_ns
                && self.nodes.is_on_bus(port, start_ns);
            may.then_some(candidate)
        })
    }

    fn candidate(&self, port: usize, start_ns: u64) -> Option<Candidate> {
        let queued = self.nodes.stations[port].transmit.most_urgent(start_ns);
        let queued = queued.map(|&queued| Candidate { port, queued, babbles: None });
        match self.babbled(port, start_ns) {
            Some(babbled) if queued.is_none_or(|queued| babbled.id() < queued.id()) => Some(babbled),
            _ => queued,
        }
    }

    fn babbled(&self, port: usize, start_ns: u64) -> Option<Candidate> {
        let (activation, frame) = self.nodes.faults.makes_babble(start_ns, port)?;
        let queued = Queued::new(frame, self.nodes.config.bitrate, start_ns);
        Some(Candidate { port, queued, babbles: Some(activation) })
    }

    /// Whether a port that does not send the frame receives it.
    fn is_acknowledged(&self, transmission: &Transmission) -> bool {
        (0..self.nodes.stations.len())
            .any(|port| !transmission.is_from(port) && self.nodes.is_on_bus(port, transmission.start_ns))
    }

    /// The lowest port with the most urgent identifier of all wins. The frames of later ports that send the same
    /// identifier are compared with its frame; the result has the one that stays on the bus.
    fn arbitrate(&self, ports: PortSet, start_ns: u64) -> Option<(ArbitrationResult, Candidate)> {
        let winner = self.candidates(ports, start_ns).min_by_key(Candidate::id)?;
        let (mut arbitration, mut strongest) = (ArbitrationResult::default(), winner);
        arbitration.admit(winner);
        let rivals = self.candidates(ports.above(winner.port), start_ns);
        for rival in rivals.filter(|rival| rival.id() == winner.id()) {
            let difference = first_difference(&strongest.queued.frame, &rival.queued.frame);
            let Some(difference) = difference else {
                arbitration.admit(rival);
                continue;
            };
            let loser = if difference.first_is_dominant { rival } else { strongest };
            if self.nodes.stations[loser.port].confinement.state() == ErrorState::Active {
                arbitration.admit(rival);
                arbitration.destroyed_at =
                    Some(arbitration.destroyed_at.map_or(difference.bit, |bit| bit.min(difference.bit)));
            } else if difference.first_is_dominant {
                // A passive error flag is recessive: the dominant frame goes on.
                arbitration.losers.add(rival.port);
            } else {
                arbitration.losers.0 |= arbitration.senders.0;
                (arbitration.senders, arbitration.babbling) = (PortSet::default(), PortSet::default());
                arbitration.admit(rival);
                strongest = rival;
            }
        }
        Some((arbitration, strongest))
    }
}

/// The result of an arbitration: ports that send one identifier at once.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ArbitrationResult {
    /// All ports with the same frame.
    pub(super) senders: PortSet,
    /// The senders that babble.
    pub(super) babbling: PortSet,
    /// Ports that sent another frame and detected the difference.
    pub(super) losers: PortSet,
    /// The bit at which a difference destroys the frame.
    destroyed_at: Option<u32>,
}

impl ArbitrationResult {
    fn admit(&mut self, candidate: Candidate) {
        self.senders.add(candidate.port);
        if candidate.babbles.is_some() {
            self.babbling.add(candidate.port);
        }
    }
}

impl Transmission {
    /// Whether the port sent that identifier. A loser has signalled an error and does not receive the frame.
    pub(super) fn is_from(&self, port: usize) -> bool {
        self.arbitration.senders.contains(port) || self.arbitration.losers.contains(port)
    }

    /// An error flag begins behind bit number `bit` of the frame.
    fn destroy(&mut self, nodes: &Nodes, bit: u32, kind: ErrorKind) {
        let is_echoed = (0..nodes.stations.len()).any(|port| {
            !self.arbitration.senders.contains(port)
                && nodes.is_on_bus(port, self.start_ns)
                && nodes.stations[port].confinement.state() == ErrorState::Active
        });
        let flag_bits = if is_echoed { 2 * ERROR_FLAG_BITS } else { ERROR_FLAG_BITS };
        let error_ns = self.start_ns + nodes.config.bitrate.bits_to_ns(bit);
        self.end_in_error_frame(nodes, error_ns, flag_bits);
        self.outcome = TransmissionOutcome::Destroyed(kind);
    }

    /// The transmitter alone signals an error in the last bit of the frame.
    fn repeat(&mut self, nodes: &Nodes) {
        self.end_in_error_frame(nodes, self.received_ns, LATE_FLAG_BITS);
        self.outcome = TransmissionOutcome::ReceivedAndRepeated;
    }

    fn end_in_error_frame(&mut self, nodes: &Nodes, error_ns: u64, flag_bits: u32) {
        let (bitrate, bits) = (nodes.config.bitrate, flag_bits + ERROR_DELIMITER_BITS);
        self.end_ns = error_ns + bitrate.bits_to_ns(bits);
        self.idle_from_ns = error_ns + bitrate.bits_to_ns(bits + INTERFRAME_BITS);
    }
}
