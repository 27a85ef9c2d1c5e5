//! Who gets the wire next, and how the attempt will end.
//!
//! Everything here is a function of the wire's present state, so that the next event can be foretold
//! without changing anything.

use std::cmp::Ordering;

use super::queue::Queued;
use super::{Traffic, VirtualWire};
use crate::bus::ErrorState;
use crate::error_frame::ErrorKind;
use crate::faults::{NumberedFrame, Strike};
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

    fn is_several(self) -> bool {
        self.0.count_ones() > 1
    }

    fn ports(self) -> impl Iterator<Item = usize> {
        let mut rest = self.0;
        std::iter::from_fn(move || {
            let port = rest.trailing_zeros() as usize;
            rest &= rest.wrapping_sub(1);
            (port < Self::CAPACITY).then_some(port)
        })
    }
}

/// A frame on the wire. It stays where it is until the attempt has ended: to look ahead is not to copy it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Attempt {
    /// The port whose frame it is: its most urgent one, or what a fault makes it babble.
    port: usize,
    /// That fault.
    babble: Option<usize>,
    pub(super) queued_ns: u64,
    pub(super) start_ns: u64,
    /// When the last end-of-frame bit is, or would have been, over.
    pub(super) received_ns: u64,
    /// When that is over, or the delimiter of the error frame.
    pub(super) end_ns: u64,
    /// When the next frame may start.
    pub(super) idle_from_ns: u64,
    /// Who sends it: all that have the same frame to send.
    pub(super) senders: PortSet,
    /// Those of them that babble.
    pub(super) babbling: PortSet,
    /// Who sent another frame of its identifier, and noticed.
    pub(super) losers: PortSet,
    pub(super) ending: Ending,
    pub(super) strike: Option<Strike>,
}

/// How an attempt ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Ending {
    /// All receive the frame.
    Received,
    /// All receive it, and its transmitter repeats it.
    ReceivedAndRepeated,
    /// An error frame ends it.
    Destroyed(ErrorKind),
}

/// What a port would send.
#[derive(Clone, Copy)]
struct Offer<'a> {
    port: usize,
    queued: &'a Queued,
    babbles: Option<Strike>,
}

impl Offer<'_> {
    fn id(&self) -> CanId {
        self.queued.frame.id()
    }
}

impl VirtualWire {
    /// What comes next if nothing else is queued until then.
    pub(super) fn foretell(&self) -> Traffic {
        let contenders = self.contenders();
        // As soon as the bus is idle and somebody has something to send.
        let start_ns = contenders.ports().filter_map(|port| self.ready_ns(port)).min();
        match start_ns.and_then(|start_ns| self.attempt(contenders, start_ns)) {
            Some(attempt) => Traffic::Coming { attempt, is_on_wire: false },
            None => Traffic::Nothing,
        }
    }

    /// Who may have something to send, now or later.
    fn contenders(&self) -> PortSet {
        let mut contenders = PortSet::default();
        for (port, station) in self.stations.iter().enumerate() {
            // A node that babbles needs no queue.
            if !station.transmit.is_empty() || !self.faults.is_empty() {
                contenders.add(port);
            }
        }
        contenders
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

    /// The attempt that an arbitration at that time leads to; `None` where nobody can send then.
    fn attempt(&self, contenders: PortSet, start_ns: u64) -> Option<Attempt> {
        let (winner, is_contested) = self.arbitrate(contenders, start_ns)?;
        let (contest, strongest) = if is_contested {
            self.contest(contenders, start_ns, winner)
        } else {
            (Contest::of(winner), winner)
        };
        let Queued { ref frame, duration_ns, since_ns } = *strongest.queued;
        let numbered =
            NumberedFrame { at_ns: start_ns, port: strongest.port, id: frame.id(), number: self.attempts };
        let mut attempt = Attempt {
            port: strongest.port,
            babble: strongest.babbles.map(|strike| strike.place),
            queued_ns: if strongest.babbles.is_some() { start_ns } else { since_ns },
            start_ns,
            received_ns: start_ns + duration_ns - self.interframe_ns,
            end_ns: start_ns + duration_ns - self.interframe_ns,
            idle_from_ns: start_ns + duration_ns,
            senders: contest.senders,
            babbling: contest.babbling,
            losers: contest.losers,
            ending: Ending::Received,
            strike: strongest.babbles,
        };
        if let Some(bit) = contest.destroyed_at {
            attempt.destroy(self, frame, bit, ErrorKind::Bit);
        } else if let Some(strike) = self.faults.corrupts(numbered) {
            let last = frame_bits(frame).total() - INTERFRAME_BITS;
            attempt.strike = Some(strike);
            attempt.destroy(self, frame, 1 + self.faults.pick(strike, self.attempts, last), ErrorKind::Bit);
        } else if !self.is_acknowledged(&attempt) {
            let slot = frame_bits(frame).total() - INTERFRAME_BITS - BEHIND_ACKNOWLEDGE_BITS;
            attempt.destroy(self, frame, slot, ErrorKind::Acknowledge);
        } else if let Some(strike) = self.faults.duplicates(numbered) {
            attempt.strike = Some(strike);
            attempt.repeat(self);
        }
        Some(attempt)
    }

    /// The frame of an attempt that has not ended.
    pub(super) fn frame_of(&self, attempt: &Attempt) -> Frame {
        let queued = match attempt.babble {
            Some(fault) => self.babble[fault].as_ref(),
            None => self.stations[attempt.port].transmit.most_urgent(attempt.start_ns),
        };
        queued.expect("a frame stays queued until it was sent").frame
    }

    /// Whether a port takes part in what happens on the wire.
    pub(super) fn is_on_bus(&self, port: usize, now_ns: u64) -> bool {
        !self.stations[port].confinement.is_off() && !self.faults.is_disconnected(now_ns, port)
    }

    /// What each of those ports would send at that time.
    fn offers(&self, contenders: PortSet, start_ns: u64) -> impl Iterator<Item = Offer<'_>> {
        contenders.ports().filter_map(move |port| {
            let offer = self.offer(port, start_ns)?;
            let may = self.stations[port].suspended_until_ns <= start_ns && self.is_on_bus(port, start_ns);
            may.then_some(offer)
        })
    }

    fn offer(&self, port: usize, start_ns: u64) -> Option<Offer<'_>> {
        let queued = self.stations[port].transmit.most_urgent(start_ns);
        let queued = queued.map(|queued| Offer { port, queued, babbles: None });
        match self.babbled(port, start_ns) {
            Some(babbled) if queued.is_none_or(|queued| babbled.id() < queued.id()) => Some(babbled),
            _ => queued,
        }
    }

    fn babbled(&self, port: usize, start_ns: u64) -> Option<Offer<'_>> {
        let (strike, _) = self.faults.makes_babble(start_ns, port)?;
        let queued = self.babble[strike.place].as_ref()?;
        Some(Offer { port, queued, babbles: Some(strike) })
    }

    /// Whether some port that does not send the frame hears it.
    fn is_acknowledged(&self, attempt: &Attempt) -> bool {
        (0..self.stations.len()).any(|port| !attempt.is_from(port) && self.is_on_bus(port, attempt.start_ns))
    }

    /// The lowest port with the most urgent identifier of all, and whether another port offers that too.
    fn arbitrate(&self, contenders: PortSet, start_ns: u64) -> Option<(Offer<'_>, bool)> {
        let mut offers = self.offers(contenders, start_ns);
        let first = (offers.next()?, false);
        Some(offers.fold(first, |(winner, is_contested), offer| match offer.id().cmp(&winner.id()) {
            Ordering::Less => (offer, false),
            Ordering::Equal => (winner, true),
            Ordering::Greater => (winner, is_contested),
        }))
    }

    /// Sorts out who sends the winning identifier too.
    fn contest<'a>(&'a self, contenders: PortSet, start_ns: u64, winner: Offer<'a>) -> (Contest, Offer<'a>) {
        let mut contest = Contest::of(winner);
        let mut strongest = winner;
        let is_rival = |offer: &Offer| offer.port > winner.port && offer.id() == winner.id();
        for rival in self.offers(contenders, start_ns).filter(is_rival) {
            let difference = first_difference(&strongest.queued.frame, &rival.queued.frame);
            let Some(difference) = difference else {
                contest.admit(rival);
                continue;
            };
            let loser = if difference.first_is_dominant { rival } else { strongest };
            if self.stations[loser.port].confinement.state() == ErrorState::Active {
                contest.admit(rival);
                contest.destroyed_at =
                    Some(contest.destroyed_at.map_or(difference.bit, |bit| bit.min(difference.bit)));
            } else if difference.first_is_dominant {
                // A passive error flag is recessive: the dominant frame goes on.
                contest.losers.add(rival.port);
            } else {
                contest.losers.0 |= contest.senders.0;
                (contest.senders, contest.babbling) = (PortSet::default(), PortSet::default());
                contest.admit(rival);
                strongest = rival;
            }
        }
        (contest, strongest)
    }
}

/// Ports that send one identifier at once.
#[derive(Default)]
struct Contest {
    senders: PortSet,
    babbling: PortSet,
    losers: PortSet,
    destroyed_at: Option<u32>,
}

impl Contest {
    fn of(offer: Offer<'_>) -> Self {
        let mut contest = Self::default();
        contest.admit(offer);
        contest
    }

    fn admit(&mut self, offer: Offer<'_>) {
        self.senders.add(offer.port);
        if offer.babbles.is_some() {
            self.babbling.add(offer.port);
        }
    }
}

impl Attempt {
    /// Whether the port sent that identifier: who lost has signalled an error and hears no more of the frame.
    pub(super) fn is_from(&self, port: usize) -> bool {
        self.senders.contains(port) || self.losers.contains(port)
    }

    /// Several ports sent the same identifier.
    pub(super) fn is_collision(&self) -> bool {
        self.senders.is_several() || self.losers != PortSet::default()
    }

    /// An error flag begins behind bit number `bit` of the frame.
    fn destroy(&mut self, wire: &VirtualWire, frame: &Frame, bit: u32, kind: ErrorKind) {
        let is_echoed = (0..wire.stations.len()).any(|port| {
            !self.senders.contains(port)
                && wire.is_on_bus(port, self.start_ns)
                && wire.stations[port].confinement.state() == ErrorState::Active
        });
        let flag_bits = if is_echoed { 2 * ERROR_FLAG_BITS } else { ERROR_FLAG_BITS };
        let rates = wire.config.rates;
        let error_ns = self.start_ns + rates.time_to_bit_ns(frame_bits(frame), bit);
        self.end_in_error_frame(wire, error_ns, flag_bits);
        self.ending = Ending::Destroyed(kind);
    }

    /// The transmitter alone signals an error in the last bit of the frame.
    fn repeat(&mut self, wire: &VirtualWire) {
        self.end_in_error_frame(wire, self.received_ns, LATE_FLAG_BITS);
        self.ending = Ending::ReceivedAndRepeated;
    }

    fn end_in_error_frame(&mut self, wire: &VirtualWire, error_ns: u64, flag_bits: u32) {
        let nominal = wire.config.rates.nominal();
        self.end_ns = error_ns + nominal.bits_to_ns(flag_bits + ERROR_DELIMITER_BITS);
        self.idle_from_ns = error_ns + nominal.bits_to_ns(flag_bits + ERROR_DELIMITER_BITS + INTERFRAME_BITS);
    }
}
