//! Faults of a CAN link: which frames and nodes they strike, when, and by which chance.
//!
//! Purely declarative, and deterministic: whether a fault strikes a frame is a function of the seed, the
//! fault and the frame's number, not of how often anybody asks. Who carries faults out is the
//! [`VirtualWire`](super::VirtualWire), or on any other bus [`PortFaults`](super::wrapped::PortFaults).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use super::frame::Frame;
use super::id::CanId;

/// What a fault does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FaultKind {
    /// Destroys a frame on the wire: an error frame follows, then the transmitter repeats.
    Corrupt,
    /// Makes a receiver lose a frame without anybody noticing.
    Lose,
    /// Holds a frame back before it is queued for transmission.
    Delay {
        /// For how long, ns.
        by_ns: u64,
    },
    /// Disturbs the last bit of the end of frame at the transmitter alone: the receivers have taken the
    /// frame, and the transmitter repeats it.
    Duplicate,
    /// Makes a node send a frame whenever the bus is idle.
    Babble {
        /// The frame.
        frame: Frame,
    },
    /// Takes a node off the wire: it neither sends nor hears nor acknowledges, and its queue fills.
    Disconnect,
    /// Sends a node's controller into bus-off.
    BusOff,
}

impl FaultKind {
    fn delay_ns(self) -> Option<u64> {
        match self {
            Self::Delay { by_ns } => Some(by_ns),
            _ => None,
        }
    }

    fn babbled(self) -> Option<Frame> {
        match self {
            Self::Babble { frame } => Some(frame),
            _ => None,
        }
    }

    /// For faults of which nothing but their kind matters.
    fn is(wanted: Self) -> impl Fn(Self) -> Option<()> {
        move |kind| (kind == wanted).then_some(())
    }
}

/// One fault.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// By which it is told of and makes its choices; its own in the whole link.
    pub number: usize,
    /// What it does.
    pub kind: FaultKind,
    /// From when on, ns.
    pub from_ns: u64,
    /// Until when, ns.
    pub until_ns: u64,
    /// Frames of this identifier only.
    pub id: Option<CanId>,
    /// The port concerned: of frames their sender, of lost frames the receiver, else the node itself.
    pub port: Option<usize>,
    /// Chance that it strikes a frame, 0 to 1.
    pub probability: f64,
    /// Strikes after which it ends.
    pub count: u64,
}

/// A fault began or ended to do something.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultNote {
    /// When, ns.
    pub time_ns: u64,
    /// The fault's number.
    pub fault: usize,
    /// The node concerned, if the fault names one.
    pub port: Option<usize>,
    /// How often it has struck; 0 at its beginning.
    pub strikes: u64,
    /// Whether it is over.
    pub has_ended: bool,
}

/// A frame as faults choose it.
#[derive(Debug, Clone, Copy)]
pub(super) struct NumberedFrame {
    /// When it would be struck, ns.
    pub(super) at_ns: u64,
    /// The port concerned.
    pub(super) port: usize,
    pub(super) id: CanId,
    /// No other frame of which the same is asked has it.
    pub(super) number: u64,
}

/// The faults of one bus, and what they did.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    list: Vec<Listed>,
    seed: u64,
}

#[derive(Debug, Clone, Copy)]
struct Listed {
    fault: Fault,
    strikes: u64,
    began_ns: Option<u64>,
    is_begin_told: bool,
    is_end_told: bool,
}

impl Listed {
    fn is_live(&self, now_ns: u64) -> bool {
        (self.fault.from_ns..self.fault.until_ns).contains(&now_ns) && self.strikes < self.fault.count
    }

    fn concerns(&self, port: usize, id: CanId) -> bool {
        self.fault.port.is_none_or(|own| own == port) && self.fault.id.is_none_or(|own| own == id)
    }
}

impl Faults {
    /// These faults; the same seed makes the same choices.
    pub fn new(faults: Vec<Fault>, seed: u64) -> Self {
        let listed =
            |fault| Listed { fault, strikes: 0, began_ns: None, is_begin_told: false, is_end_told: false };
        Self { list: faults.into_iter().map(listed).collect(), seed }
    }

    /// Whether there are none.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// What each of them makes a node say, in their order.
    pub(super) fn babbled(&self) -> impl Iterator<Item = Option<Frame>> {
        self.list.iter().map(|listed| listed.fault.kind.babbled())
    }

    /// The fault that destroys a frame.
    pub(super) fn corrupts(&self, frame: NumberedFrame) -> Option<Strike> {
        self.strikes(frame, FaultKind::is(FaultKind::Corrupt)).map(|(strike, ())| strike)
    }

    /// The fault that has a frame sent twice.
    pub(super) fn duplicates(&self, frame: NumberedFrame) -> Option<Strike> {
        self.strikes(frame, FaultKind::is(FaultKind::Duplicate)).map(|(strike, ())| strike)
    }

    /// The fault that holds a frame back, and for how long, ns.
    pub(super) fn delays(&self, frame: NumberedFrame) -> Option<(Strike, u64)> {
        self.strikes(frame, FaultKind::delay_ns)
    }

    /// Whether a fault makes the frame's port, which receives it, lose it; that is recorded.
    pub(super) fn loses(&mut self, frame: NumberedFrame) -> bool {
        let strike = self.strikes(frame, FaultKind::is(FaultKind::Lose));
        strike.inspect(|&(strike, ())| self.record(strike)).is_some()
    }

    /// The first fault of those that `part` selects that strikes the frame, with what `part` takes from it.
    #[inline]
    fn strikes<T>(
        &self,
        NumberedFrame { at_ns, port, id, number }: NumberedFrame,
        part: impl Fn(FaultKind) -> Option<T>,
    ) -> Option<(Strike, T)> {
        self.unless_empty(|list| {
            list.iter().enumerate().find_map(|(place, listed)| {
                let part = part(listed.fault.kind)?;
                let may = listed.is_live(at_ns) && listed.concerns(port, id);
                let strikes = may && self.chance(place, number).random_bool(listed.fault.probability);
                strikes.then_some((Strike { place, at_ns }, part))
            })
        })
    }

    /// A number from 0 to `below` − 1 for a fault and a frame.
    pub(super) fn pick(&self, strike: Strike, number: u64, below: u32) -> u32 {
        let mut chance = self.chance(strike.place, number);
        let _: f64 = chance.random();
        chance.random_range(0..below.max(1))
    }

    /// Whether a node is disconnected at that time.
    pub(super) fn is_disconnected(&self, now_ns: u64, port: usize) -> bool {
        self.of_node(now_ns, port, FaultKind::is(FaultKind::Disconnect)).is_some()
    }

    /// The fault that puts a node off the bus at that time.
    pub(super) fn puts_off(&self, now_ns: u64, port: usize) -> Option<Strike> {
        self.of_node(now_ns, port, FaultKind::is(FaultKind::BusOff)).map(|(strike, ())| strike)
    }

    /// The fault that makes a node babble at that time, and what it says.
    pub(super) fn makes_babble(&self, now_ns: u64, port: usize) -> Option<(Strike, Frame)> {
        self.of_node(now_ns, port, FaultKind::babbled)
    }

    #[inline]
    fn of_node<T>(
        &self,
        now_ns: u64,
        port: usize,
        part: impl Fn(FaultKind) -> Option<T>,
    ) -> Option<(Strike, T)> {
        self.unless_empty(|list| {
            let mut live = of_port(list, port, part).filter(|(_, listed, _)| listed.is_live(now_ns));
            live.next().map(|(place, listed, part)| (Strike { place, at_ns: listed.fault.from_ns }, part))
        })
    }

    /// When a node is connected, from `from_ns` on.
    #[inline]
    pub(super) fn connected_from_ns(&self, from_ns: u64, port: usize) -> u64 {
        let mut connected_ns = from_ns;
        // Each turn leaves one disconnection behind.
        while let Some((off, ())) = self.of_node(connected_ns, port, FaultKind::is(FaultKind::Disconnect)) {
            connected_ns = self.list[off.place].fault.until_ns;
        }
        connected_ns
    }

    /// When a fault next makes a node babble that can do so from `able_ns` on.
    #[inline]
    pub(super) fn babbles_from_ns(&self, able_ns: u64, port: usize) -> Option<u64> {
        self.unless_empty(|list| {
            let babbles = of_port(list, port, FaultKind::babbled);
            let starts_ns = babbles.filter_map(|(_, listed, _)| {
                let from_ns = self.connected_from_ns(able_ns.max(listed.fault.from_ns), port);
                listed.is_live(from_ns).then_some(from_ns)
            });
            starts_ns.min()
        })
    }

    /// A fault has struck.
    pub(super) fn record(&mut self, strike: Strike) {
        let listed = &mut self.list[strike.place];
        listed.began_ns.get_or_insert(strike.at_ns);
        listed.strikes += 1;
    }

    /// The next forced bus-off of a node that is on the bus from `from_ns` on.
    pub(super) fn next_bus_off(&self, from_ns: u64, port: usize) -> Option<Strike> {
        let bus_offs = of_port(&self.list, port, FaultKind::is(FaultKind::BusOff));
        let strikes = bus_offs.filter_map(|(place, listed, ())| {
            let at_ns = listed.fault.from_ns.max(from_ns);
            listed.is_live(at_ns).then_some(Strike { place, at_ns })
        });
        strikes.min_by_key(|strike| strike.at_ns)
    }

    /// Disconnections act by themselves; what they strike is not counted.
    pub(super) fn begin_disconnections(&mut self, now_ns: u64) {
        let off = self.list.iter_mut().filter(|listed| listed.fault.kind == FaultKind::Disconnect);
        for listed in off.filter(|listed| listed.fault.from_ns <= now_ns && listed.fault.count > 0) {
            listed.began_ns.get_or_insert(listed.fault.from_ns);
        }
    }

    /// What is to be told of the faults up to `now_ns`: each tells once that it acts, and once that it
    /// is over.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.list.iter_mut().find_map(|listed| {
            let began_ns = listed.began_ns?;
            let Fault { number: fault, port, .. } = listed.fault;
            if !listed.is_begin_told {
                listed.is_begin_told = true;
                return Some(FaultNote { time_ns: began_ns, fault, port, strikes: 0, has_ended: false });
            }
            if !listed.is_end_told && !listed.is_live(now_ns) {
                listed.is_end_told = true;
                let strikes = listed.strikes;
                return Some(FaultNote { time_ns: now_ns, fault, port, strikes, has_ended: true });
            }
            None
        })
    }

    /// Most wires have none, and ask several times a frame: to see that is all that is done there.
    #[inline(always)]
    fn unless_empty<T>(&self, ask: impl FnOnce(&[Listed]) -> Option<T>) -> Option<T> {
        #[cold]
        fn ask_some<T>(list: &[Listed], ask: impl FnOnce(&[Listed]) -> Option<T>) -> Option<T> {
            ask(list)
        }
        if self.is_empty() { None } else { ask_some(&self.list, ask) }
    }

    /// Random numbers for a fault and a frame, the same however often they are asked for.
    fn chance(&self, place: usize, number: u64) -> Pcg32 {
        const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
        let fault = self.list[place].fault.number as u64;
        let key = self.seed ^ (fault + 1).wrapping_mul(ODD).rotate_left(32) ^ number.wrapping_mul(ODD);
        Pcg32::seed_from_u64(key)
    }
}

/// Those at a port, with their places and what `part` takes from them.
fn of_port<T>(
    list: &[Listed],
    port: usize,
    part: impl Fn(FaultKind) -> Option<T>,
) -> impl Iterator<Item = (usize, &Listed, T)> {
    let of_port =
        list.iter().enumerate().filter(move |(_, listed)| listed.fault.port.is_none_or(|own| own == port));
    of_port.filter_map(move |(place, listed)| Some((place, listed, part(listed.fault.kind)?)))
}

/// A fault that strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Strike {
    /// Of the fault in the list.
    pub(super) place: usize,
    pub(super) at_ns: u64,
}

#[cfg(test)]
mod tests;
