//! The nodes of a simulated wire: the next sender, the result of its transmission, and the changes at its end.
//!
//! The next transmission is a function of the present state, so a caller can ask for it without changing the state.

use super::controller::{Confinement, Queued, ReceiveQueue, TransmitQueue};
use crate::faults::{FaultActivation, Faults, NumberedFrame};
use crate::wire::{BEHIND_ACKNOWLEDGE_BITS, INTERFRAME_BITS, first_difference, frame_bits};
use crate::{Bitrate, CanId, ErrorKind, ErrorReport, ErrorState, Frame, Received, Tapped, TappedFrame};

const ERROR_FLAG_BITS: u32 = 6;
const ERROR_DELIMITER_BITS: u32 = 8;
/// Overload flags answer a dominant bit behind the end of frame one bit later.
const LATE_FLAG_BITS: u32 = 7;
/// Pause of an error passive transmitter before its next frame, behind the interframe space.
const SUSPEND_BITS: u32 = 8;

/// Settings of a wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct WireConfig {
    /// Bit rate.
    pub bitrate: Bitrate,
    /// Ports, one a node.
    pub ports: usize,
    /// Frames a port may have waiting for transmission.
    pub transmit_capacity: usize,
    /// Received frames that a port may hold; the tap's queue is as long for each port.
    pub receive_capacity: usize,
    /// Time from bus-off to a port's own restart, ns; `None` for never.
    pub restart_after_ns: Option<u64>,
}

/// A port with its controller.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Station {
    pub(super) transmit: TransmitQueue,
    pub(super) receive: ReceiveQueue<Received>,
    pub(super) confinement: Confinement,
    /// The time from which the node takes part on the bus, ns.
    pub(super) on_bus_from_ns: u64,
    /// A passive transmitter sends nothing before this time, ns.
    suspended_until_ns: u64,
}

/// All nodes, their faults, and the state and the tap of the wire between them.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Nodes {
    pub(super) config: WireConfig,
    pub(super) stations: Vec<Station>,
    pub(super) faults: Faults,
    pub(super) tap: ReceiveQueue<Tapped>,
    /// Transmissions so far. Faults select transmissions by this number.
    pub(super) transmissions: u64,
    pub(super) idle_from_ns: u64,
    /// Duration of the interframe space, ns.
    interframe_ns: u64,
}

/// A set of ports. Two words cost fewer instructions than a `u128` or an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub(super) struct PortSet {
    /// A bit for each port below 64, and for each port from there on.
    low: u64,
    high: u64,
}

impl PortSet {
    /// Ports a wire may have.
    pub(super) const CAPACITY: usize = 128;

    #[inline]
    fn contains(self, port: usize) -> bool {
        let word = if port < 64 { self.low } else { self.high };
        word >> (port & 63) & 1 == 1
    }

    #[inline]
    fn add(&mut self, port: usize) {
        let word = if port < 64 { &mut self.low } else { &mut self.high };
        *word |= 1 << (port & 63);
    }

    #[inline]
    fn add_all(&mut self, other: Self) {
        self.low |= other.low;
        self.high |= other.high;
    }

    #[inline]
    fn iter(self) -> impl Iterator<Item = usize> {
        let Self { mut low, mut high } = self;
        std::iter::from_fn(move || {
            if low != 0 {
                let port = low.trailing_zeros() as usize;
                low &= low - 1;
                return Some(port);
            }
            let port = high.trailing_zeros() as usize;
            high &= high.wrapping_sub(1);
            (port < 64).then_some(64 + port)
        })
    }
}

/// A transmission of a frame, which stays queued until the transmission has ended.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
pub(super) struct Transmission {
    frame: Frame,
    queued_ns: u64,
    pub(super) start_ns: u64,
    /// End of the last end-of-frame bit without a disturbance.
    received_ns: u64,
    /// End of the frame, or of the delimiter of the error frame, ns.
    pub(super) end_ns: u64,
    /// When the next frame may start.
    idle_from_ns: u64,
    arbitration: ArbitrationResult,
    outcome: TransmissionOutcome,
    activation: Option<FaultActivation>,
}

/// How a transmission ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum TransmissionOutcome {
    /// All nodes receive the frame.
    Received,
    /// All nodes receive the frame, and the transmitter repeats it.
    ReceivedAndRepeated,
    /// An error frame ends the transmission.
    Destroyed(ErrorKind),
}

/// The result of an arbitration: ports that send one identifier at once.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
struct ArbitrationResult {
    /// All ports with the same frame.
    senders: PortSet,
    /// The senders that babble.
    babbling: PortSet,
    /// Ports that sent another frame and detected the difference.
    losers: PortSet,
    /// The bit at which a difference destroys the frame.
    destroyed_at: Option<u32>,
}

/// The frame that a port sends next.
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

impl ArbitrationResult {
    fn admit(&mut self, candidate: Candidate) {
        self.senders.add(candidate.port);
        if candidate.babbles.is_some() {
            self.babbling.add(candidate.port);
        }
    }
}

impl Nodes {
    pub(super) fn new(config: &WireConfig, faults: Faults) -> Self {
        let station = |_| Station {
            transmit: TransmitQueue::new(config.transmit_capacity),
            receive: ReceiveQueue::new(config.receive_capacity),
            confinement: Confinement::default(),
            on_bus_from_ns: 0,
            suspended_until_ns: 0,
        };
        Self {
            config: *config,
            stations: (0..config.ports).map(station).collect(),
            faults,
            tap: ReceiveQueue::new(config.receive_capacity * config.ports),
            transmissions: 0,
            idle_from_ns: 0,
            interframe_ns: config.bitrate.bits_to_ns(INTERFRAME_BITS),
        }
    }

    /// Whether a port takes part in the traffic.
    fn is_on_bus(&self, port: usize, now_ns: u64) -> bool {
        !self.stations[port].confinement.is_off() && !self.faults.is_disconnected(now_ns, port)
    }

    /// Changes a port's fault confinement. The tap gets a change of state. A port that leaves the bus discards its
    /// queue.
    pub(super) fn confine(&mut self, port: usize, now_ns: u64, change: impl FnOnce(&mut Confinement)) {
        let station = &mut self.stations[port];
        let before = station.confinement.state();
        change(&mut station.confinement);
        let status = station.confinement.status();
        if status.state == before {
            return;
        }
        let kind = ErrorKind::State(status.state);
        self.tap.push(now_ns, Tapped::Error(ErrorReport::new(now_ns, port as u8, kind, status)));
        if status.state == ErrorState::BusOff {
            station.transmit.frames.clear();
        }
    }

    /// The next transmission, if no other frame is queued until then.
    pub(super) fn next_transmission(&self) -> Option<Transmission> {
        let ports = self.candidate_ports();
        // As soon as the bus is idle and a node has something to send.
        let start_ns = ports.iter().filter_map(|port| self.ready_ns(port)).min()?;
        let (arbitration, strongest) = self.arbitrate(ports, start_ns)?;
        let Queued { frame, duration_ns, since_ns: queued_ns } = strongest.queued;
        let (port, id, number) = (strongest.port, frame.id(), self.transmissions);
        let numbered = NumberedFrame { at_ns: start_ns, port, id, number };
        let end_ns = start_ns + duration_ns - self.interframe_ns;
        let mut transmission = Transmission {
            frame,
            queued_ns,
            start_ns,
            received_ns: end_ns,
            end_ns,
            idle_from_ns: start_ns + duration_ns,
            arbitration,
            outcome: TransmissionOutcome::Received,
            activation: strongest.babbles,
        };
        if let Some(bit) = arbitration.destroyed_at {
            transmission.destroy(self, bit, ErrorKind::Bit);
        } else if let Some(activation) = self.faults.corrupts(numbered) {
            let last = frame_bits(&frame) - INTERFRAME_BITS;
            let bit = 1 + self.faults.pick(activation, number, last);
            transmission.activation = Some(activation);
            transmission.destroy(self, bit, ErrorKind::Bit);
        } else if !self.is_acknowledged(&transmission) {
            let slot = frame_bits(&frame) - INTERFRAME_BITS - BEHIND_ACKNOWLEDGE_BITS;
            transmission.destroy(self, slot, ErrorKind::Acknowledge);
        } else if let Some(activation) = self.faults.duplicates(numbered) {
            // The transmitter alone signals an error in the last bit of the frame.
            transmission.activation = Some(activation);
            transmission.outcome = TransmissionOutcome::ReceivedAndRepeated;
            transmission.end_in_error_frame(self.config.bitrate, end_ns, LATE_FLAG_BITS);
        }
        Some(transmission)
    }

    /// The ports that may have a frame to send, now or later.
    fn candidate_ports(&self) -> PortSet {
        let mut ports = PortSet::default();
        for (port, station) in self.stations.iter().enumerate() {
            // A node that babbles needs no queue.
            if !station.transmit.frames.is_empty() || !self.faults.is_empty() {
                ports.add(port);
            }
        }
        ports
    }

    /// When a port can next take part in an arbitration, if at all.
    fn ready_ns(&self, port: usize) -> Option<u64> {
        let station = &self.stations[port];
        if station.confinement.is_off() {
            return None;
        }
        let may_ns = station.suspended_until_ns.max(station.on_bus_from_ns).max(self.idle_from_ns);
        let queued_ns = station.transmit.earliest_ns();
        let sends_ns = queued_ns.map(|since_ns| self.faults.connected_from_ns(may_ns.max(since_ns), port));
        let babbles_ns = self.faults.babbles_from_ns(may_ns, port);
        let at_ns = sends_ns.unwrap_or(u64::MAX).min(babbles_ns.unwrap_or(u64::MAX));
        (at_ns < u64::MAX).then_some(at_ns)
    }

    /// The frame of each of the ports at that time.
    fn candidates(&self, ports: PortSet, start_ns: u64) -> impl Iterator<Item = Candidate> {
        ports.iter().filter_map(move |port| {
            let candidate = self.candidate(port, start_ns)?;
            let may = self.stations[port].suspended_until_ns <= start_ns && self.is_on_bus(port, start_ns);
            may.then_some(candidate)
        })
    }

    /// The most urgent frame of the port at that time: a queued one, or the one that it babbles.
    fn candidate(&self, port: usize, start_ns: u64) -> Option<Candidate> {
        let queued = self.stations[port].transmit.most_urgent(start_ns);
        let queued = queued.map(|&queued| Candidate { port, queued, babbles: None });
        let babbled = self.faults.makes_babble(start_ns, port).map(|(activation, frame)| {
            let queued = Queued::new(frame, self.config.bitrate, start_ns);
            Candidate { port, queued, babbles: Some(activation) }
        });
        babbled.filter(|babbled| queued.is_none_or(|queued| babbled.id() < queued.id())).or(queued)
    }

    /// Whether a port that does not send the frame receives it.
    fn is_acknowledged(&self, transmission: &Transmission) -> bool {
        (0..self.stations.len())
            .any(|port| !transmission.is_from(port) && self.is_on_bus(port, transmission.start_ns))
    }

    /// The lowest port with the most urgent identifier wins. Frames of later ports with the same identifier are
    /// compared with its frame; the result has the frame that stays on the bus.
    fn arbitrate(&self, ports: PortSet, start_ns: u64) -> Option<(ArbitrationResult, Candidate)> {
        let mut candidates = self.candidates(ports, start_ns);
        let (mut arbitration, mut strongest) = (ArbitrationResult::default(), candidates.next()?);
        arbitration.admit(strongest);
        for rival in candidates {
            if rival.id() > strongest.id() {
                continue;
            }
            if rival.id() < strongest.id() {
                (arbitration, strongest) = (ArbitrationResult::default(), rival);
                arbitration.admit(strongest);
                continue;
            }
            let difference = first_difference(&strongest.queued.frame, &rival.queued.frame);
            let Some(difference) = difference else {
                arbitration.admit(rival);
                continue;
            };
            let loser = if difference.first_is_dominant { rival } else { strongest };
            if self.stations[loser.port].confinement.state() == ErrorState::Active {
                arbitration.admit(rival);
                arbitration.destroyed_at =
                    Some(arbitration.destroyed_at.map_or(difference.bit, |bit| bit.min(difference.bit)));
            } else if difference.first_is_dominant {
                // A passive error flag is recessive: the dominant frame goes on.
                arbitration.losers.add(rival.port);
            } else {
                arbitration.losers.add_all(arbitration.senders);
                (arbitration.senders, arbitration.babbling) = (PortSet::default(), PortSet::default());
                arbitration.admit(rival);
                strongest = rival;
            }
        }
        Some((arbitration, strongest))
    }

    /// Changes ports and tap at the end of a transmission.
    pub(super) fn end_transmission(&mut self, transmission: &Transmission) {
        self.idle_from_ns = transmission.idle_from_ns;
        if let Some(activation) = transmission.activation {
            self.faults.record(activation);
        }
        match transmission.outcome {
            TransmissionOutcome::Received => self.complete(transmission),
            TransmissionOutcome::ReceivedAndRepeated => {
                self.deliver(transmission);
                self.fail(transmission, ErrorKind::Bit);
            }
            TransmissionOutcome::Destroyed(kind) => self.fail(transmission, kind),
        }
        for (port, station) in self.stations.iter_mut().enumerate() {
            if transmission.is_from(port) && station.confinement.state() == ErrorState::Passive {
                let pause_ns = self.config.bitrate.bits_to_ns(SUSPEND_BITS);
                station.suspended_until_ns = transmission.idle_from_ns + pause_ns;
            }
            station.confinement.saw_end(transmission.idle_from_ns);
        }
    }

    /// Delivers the frame, and removes it from the queues of its senders.
    fn complete(&mut self, transmission: &Transmission) {
        let &Transmission { arbitration, end_ns, .. } = transmission;
        self.deliver(transmission);
        for port in 0..self.stations.len() {
            if arbitration.senders.contains(port) {
                self.confine(port, end_ns, Confinement::transmitted);
                if !arbitration.babbling.contains(port) {
                    self.stations[port].transmit.remove_most_urgent(transmission.start_ns);
                }
            } else if arbitration.losers.contains(port) {
                let restart_after_ns = self.config.restart_after_ns;
                self.confine(port, end_ns, |node| node.transmit_error(end_ns, restart_after_ns));
            }
        }
    }

    /// Delivers the frame to all receivers.
    fn deliver(&mut self, transmission: &Transmission) {
        let &Transmission { frame, queued_ns, start_ns, received_ns: time_ns, .. } = transmission;
        let tapped = TappedFrame { frame, time_ns, queued_ns: Some(queued_ns) };
        self.tap.push(time_ns, Tapped::Frame(tapped));
        for port in 0..self.stations.len() {
            if transmission.is_from(port) || !self.is_on_bus(port, start_ns) {
                continue;
            }
            self.confine(port, time_ns, Confinement::received);
            // Every receiver has numbers of its own, so receivers lose frames independently.
            let number = self.transmissions ^ (port as u64 + 1) << 48;
            if !self.faults.loses(NumberedFrame { at_ns: start_ns, port, id: frame.id(), number }) {
                self.stations[port].receive.push(time_ns, Received { frame, time_ns });
            }
        }
    }

    /// Handles the end by an error frame; the frame stays queued for the next attempt.
    fn fail(&mut self, transmission: &Transmission, kind: ErrorKind) {
        let is_received = transmission.outcome == TransmissionOutcome::ReceivedAndRepeated;
        for port in 0..self.stations.len() {
            if transmission.is_from(port) {
                self.fail_to_send(transmission, port, kind);
            } else if !is_received && self.is_on_bus(port, transmission.start_ns) {
                self.confine(port, transmission.end_ns, Confinement::receive_error);
            }
        }
    }

    /// Counts the error at a sender. The tap gets the error frame once, before the resulting change of state, with the
    /// first sender's counters after the error.
    fn fail_to_send(&mut self, transmission: &Transmission, port: usize, kind: ErrorKind) {
        let (now_ns, restart_after_ns) = (transmission.end_ns, self.config.restart_after_ns);
        let count = |node: &mut Confinement| match kind {
            ErrorKind::Acknowledge => node.unacknowledged(now_ns, restart_after_ns),
            _ => node.transmit_error(now_ns, restart_after_ns),
        };
        if !(0..port).any(|other| transmission.is_from(other)) {
            let mut counted = self.stations[port].confinement;
            count(&mut counted);
            let report = ErrorReport::new(now_ns, port as u8, kind, counted.status());
            self.tap.push(now_ns, Tapped::Error(report));
        }
        self.confine(port, now_ns, count);
    }
}

impl Transmission {
    /// Whether the port has sent that identifier. A loser has signalled an error and does not receive the frame.
    fn is_from(&self, port: usize) -> bool {
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
        let bitrate = nodes.config.bitrate;
        self.end_in_error_frame(bitrate, self.start_ns + bitrate.bits_to_ns(bit), flag_bits);
        self.outcome = TransmissionOutcome::Destroyed(kind);
    }

    fn end_in_error_frame(&mut self, bitrate: Bitrate, error_ns: u64, flag_bits: u32) {
        let bits = flag_bits + ERROR_DELIMITER_BITS;
        self.end_ns = error_ns + bitrate.bits_to_ns(bits);
        self.idle_from_ns = error_ns + bitrate.bits_to_ns(bits + INTERFRAME_BITS);
    }
}
