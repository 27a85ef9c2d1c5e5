//! Faults of a CAN link: their frames and nodes, their times, and their probabilities.
//!
//! The faults are declarative and deterministic. Seed, fault and number of a frame decide whether the fault acts on the
//! frame; the number of queries has no effect. [`VirtualWire`](super::VirtualWire) carries the faults out, and on any
//! other bus [`PortFaults`](super::PortFaults). This module changes no frame itself.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

use crate::frame::{CanId, Frame};

/// What a fault does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum FaultKind {
    /// Destroys a frame on the wire: an error frame follows, then the transmitter repeats.
    Corrupt,
    /// Makes a receiver lose a frame without an error on the wire.
    Lose,
    /// Holds a frame back before it is queued for transmission.
    Delay {
        /// For how long, ns.
        by_ns: u64,
    },
    /// Disturbs the last bit of the end of frame at the transmitter alone: the receivers have the frame, and the
    /// transmitter repeats the frame.
    Duplicate,
    /// Makes a node send a frame whenever the bus is idle.
    Babble {
        /// The frame.
        frame: Frame,
    },
    /// Takes a node off the wire: the node neither sends nor receives nor acknowledges, and its queue fills.
    Disconnect,
    /// Puts a node's controller into bus-off.
    BusOff,
}

/// One fault.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Fault {
    /// Number of the fault in reports and for its random choices; unique in the link.
    pub number: usize,
    /// The kind of the fault.
    pub kind: FaultKind,
    /// Begin, ns; the greatest number for an unknown begin.
    pub from_ns: u64,
    /// End, ns.
    pub until_ns: u64,
    /// Frames of this identifier only.
    pub id: Option<CanId>,
    /// The port concerned: the sender of frames, the receiver of lost frames, otherwise the node itself.
    pub port: Option<usize>,
    /// Probability that the fault acts on a frame, 0 to 1.
    pub probability: f64,
    /// Activations after which the fault ends.
    pub count: u64,
}

/// Begin or end of a fault's effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FaultNote {
    /// When, ns.
    pub time_ns: u64,
    /// The fault's number.
    pub fault: usize,
    /// The node concerned, if the fault names one.
    pub port: Option<usize>,
    /// Number of activations; 0 at the beginning.
    pub activations: u64,
    /// Whether the fault has ended.
    pub has_ended: bool,
}

/// A frame with its number for the selection by faults.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NumberedFrame {
    /// Time of a fault's effect on the frame, ns.
    pub(crate) at_ns: u64,
    /// The port concerned.
    pub(crate) port: usize,
    pub(crate) id: CanId,
    /// Unique among the frames of the same query.
    pub(crate) number: u64,
}

/// The faults of one bus, and their activations so far.
///
/// ```
/// use masseter_can::faults::{Fault, FaultKind, Faults};
/// use masseter_can::{Bus, Tapped, VirtualWire, canopen::sync};
/// # use masseter_can::{Bitrate, WireConfig};
///
/// # let config = WireConfig {
/// #     bitrate: Bitrate::MAX,
/// #     ports: 2,
/// #     transmit_capacity: 8,
/// #     receive_capacity: 8,
/// #     restart_after_ns: None,
/// # };
/// let destroys_one = Fault {
///     number: 0,
///     kind: FaultKind::Corrupt,
///     from_ns: 0,
///     until_ns: u64::MAX,
///     id: None,
///     port: None,
///     probability: 1.0,
///     count: 1,
/// };
/// let mut wire = VirtualWire::with_faults(&config, Faults::new(vec![destroys_one], 7));
/// wire.port(0).send(0, sync::frame())?;
/// wire.advance(1_000_000);
/// assert!(matches!(wire.tap(1_000_000)?, Some(Tapped::Error(_))));
/// assert!(wire.port(1).receive(1_000_000)?.is_some(), "its sender has repeated it");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, Default, serde::Serialize, serde::Deserialize)]
pub struct Faults {
    list: Vec<Listed>,
    seed: u64,
}

#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Listed {
    fault: Fault,
    activations: u64,
    began_ns: Option<u64>,
    noted: Noted,
}

/// The notes given on a fault.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
enum Noted {
    Nothing,
    Begin,
    End,
}

impl Listed {
    fn is_live(&self, now_ns: u64) -> bool {
        (self.fault.from_ns..self.fault.until_ns).contains(&now_ns) && self.activations < self.fault.count
    }

    fn concerns(&self, port: usize, id: CanId) -> bool {
        self.fault.port.is_none_or(|own| own == port) && self.fault.id.is_none_or(|own| own == id)
    }
}

impl Faults {
    /// These faults; the same seed makes the same choices.
    pub fn new(faults: Vec<Fault>, seed: u64) -> Self {
        let listed = |fault| Listed { fault, activations: 0, began_ns: None, noted: Noted::Nothing };
        Self { list: faults.into_iter().map(listed).collect(), seed }
    }

    /// Sets the time of a fault whose time is not known at the start. A number of no fault has no effect.
    pub(crate) fn set_window(&mut self, number: usize, window_ns: Range<u64>) {
        for listed in self.list.iter_mut().filter(|listed| listed.fault.number == number) {
            (listed.fault.from_ns, listed.fault.until_ns) = (window_ns.start, window_ns.end);
        }
    }

    /// Whether the list is empty.
    pub(crate) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The fault that destroys a frame.
    pub(crate) fn corrupts(&self, frame: NumberedFrame) -> Option<FaultActivation> {
        self.on_frame(frame, |kind| kind == FaultKind::Corrupt)
    }

    /// The fault that makes a transmitter send the frame twice.
    pub(crate) fn duplicates(&self, frame: NumberedFrame) -> Option<FaultActivation> {
        self.on_frame(frame, |kind| kind == FaultKind::Duplicate)
    }

    /// The fault that holds a frame back, and for how long, ns.
    pub(crate) fn delays(&self, frame: NumberedFrame) -> Option<(FaultActivation, u64)> {
        let activation = self.on_frame(frame, |kind| matches!(kind, FaultKind::Delay { by_ns: 1.. }))?;
        let FaultKind::Delay { by_ns } = self.list[activation.place].fault.kind else { return None };
        Some((activation, by_ns))
    }

    /// Whether a fault makes the receiving port lose the frame. The activation is recorded.
    pub(crate) fn loses(&mut self, frame: NumberedFrame) -> bool {
        let activation = self.on_frame(frame, |kind| kind == FaultKind::Lose);
        activation.inspect(|&activation| self.record(activation)).is_some()
    }

    /// The first fault of that kind that acts on the frame.
    #[inline]
    fn on_frame(&self, frame: NumberedFrame, is_kind: impl Fn(FaultKind) -> bool) -> Option<FaultActivation> {
        let NumberedFrame { at_ns, port, id, number } = frame;
        self.unless_empty(|list| {
            let place = list.iter().enumerate().position(|(place, listed)| {
                let may = is_kind(listed.fault.kind) && listed.is_live(at_ns) && listed.concerns(port, id);
                may && self.chance(place, number).random_bool(listed.fault.probability)
            })?;
            Some(FaultActivation { place, at_ns })
        })
    }

    /// A number from 0 to `below` − 1 for a fault and a frame.
    pub(crate) fn pick(&self, activation: FaultActivation, number: u64, below: u32) -> u32 {
        let mut chance = self.chance(activation.place, number);
        let _: f64 = chance.random();
        chance.random_range(0..below.max(1))
    }

    /// Whether a node is disconnected at that time.
    pub(crate) fn is_disconnected(&self, now_ns: u64, port: usize) -> bool {
        self.disconnection(now_ns, port).is_some()
    }

    fn disconnection(&self, now_ns: u64, port: usize) -> Option<FaultActivation> {
        self.on_node(now_ns, port, |kind| kind == FaultKind::Disconnect)
    }

    /// The fault that puts a node into bus-off at that time.
    pub(crate) fn puts_off(&self, now_ns: u64, port: usize) -> Option<FaultActivation> {
        self.on_node(now_ns, port, |kind| kind == FaultKind::BusOff)
    }

    /// The fault that makes a node babble at that time, and the babbled frame.
    pub(crate) fn makes_babble(&self, now_ns: u64, port: usize) -> Option<(FaultActivation, Frame)> {
        let activation = self.on_node(now_ns, port, |kind| matches!(kind, FaultKind::Babble { .. }))?;
        let FaultKind::Babble { frame } = self.list[activation.place].fault.kind else { return None };
        Some((activation, frame))
    }

    #[inline]
    fn on_node(
        &self,
        now_ns: u64,
        port: usize,
        is_kind: impl Fn(FaultKind) -> bool,
    ) -> Option<FaultActivation> {
        self.unless_empty(|list| {
            let (place, listed) = of_port(list, port, is_kind).find(|(_, listed)| listed.is_live(now_ns))?;
            Some(FaultActivation { place, at_ns: listed.fault.from_ns })
        })
    }

    /// The first time from `from_ns` on at which the node is connected.
    #[inline]
    pub(crate) fn connected_from_ns(&self, from_ns: u64, port: usize) -> u64 {
        let mut connected_ns = from_ns;
        // Each turn leaves one disconnection behind.
        while let Some(off) = self.disconnection(connected_ns, port) {
            connected_ns = self.list[off.place].fault.until_ns;
        }
        connected_ns
    }

    /// The next time at which a fault makes a node babble; the node can send from `able_ns` on.
    #[inline]
    pub(crate) fn babbles_from_ns(&self, able_ns: u64, port: usize) -> Option<u64> {
        self.unless_empty(|list| {
            let babbles = of_port(list, port, |kind| matches!(kind, FaultKind::Babble { .. }));
            let starts_ns = babbles.filter_map(|(_, listed)| {
                let from_ns = self.connected_from_ns(able_ns.max(listed.fault.from_ns), port);
                listed.is_live(from_ns).then_some(from_ns)
            });
            starts_ns.min()
        })
    }

    /// Counts an activation.
    pub(crate) fn record(&mut self, activation: FaultActivation) {
        let listed = &mut self.list[activation.place];
        listed.began_ns.get_or_insert(activation.at_ns);
        listed.activations += 1;
    }

    /// The next forced bus-off of a node that is on the bus from `from_ns` on.
    pub(crate) fn next_bus_off(&self, from_ns: u64, port: usize) -> Option<FaultActivation> {
        let bus_offs = of_port(&self.list, port, |kind| kind == FaultKind::BusOff);
        let next = bus_offs.filter_map(|(place, listed)| {
            let at_ns = listed.fault.from_ns.max(from_ns);
            listed.is_live(at_ns).then_some(FaultActivation { place, at_ns })
        });
        next.min_by_key(|activation| activation.at_ns)
    }

    /// Marks disconnections as begun. Suppressed frames do not count.
    pub(crate) fn begin_disconnections(&mut self, now_ns: u64) {
        let off = self.list.iter_mut().filter(|listed| listed.fault.kind == FaultKind::Disconnect);
        for listed in off.filter(|listed| listed.fault.from_ns <= now_ns && listed.fault.count > 0) {
            listed.began_ns.get_or_insert(listed.fault.from_ns);
        }
    }

    /// The next note on the faults up to `now_ns`: one when a fault acts, and one when the fault has ended.
    pub fn next_note(&mut self, now_ns: u64) -> Option<FaultNote> {
        self.list.iter_mut().find_map(|listed| {
            let began_ns = listed.began_ns?;
            let Fault { number: fault, port, .. } = listed.fault;
            let (noted, time_ns, activations) = match listed.noted {
                Noted::Nothing => (Noted::Begin, began_ns, 0),
                Noted::Begin if !listed.is_live(now_ns) => (Noted::End, now_ns, listed.activations),
                Noted::Begin | Noted::End => return None,
            };
            listed.noted = noted;
            Some(FaultNote { time_ns, fault, port, activations, has_ended: matches!(noted, Noted::End) })
        })
    }

    /// Most wires have no faults and ask several times a frame, so this case costs one comparison.
    #[inline(always)]
    fn unless_empty<T>(&self, ask: impl FnOnce(&[Listed]) -> Option<T>) -> Option<T> {
        #[cold]
        fn ask_some<T>(list: &[Listed], ask: impl FnOnce(&[Listed]) -> Option<T>) -> Option<T> {
            ask(list)
        }
        if self.is_empty() { None } else { ask_some(&self.list, ask) }
    }

    /// Random numbers that depend on fault and frame only.
    fn chance(&self, place: usize, number: u64) -> Pcg32 {
        const ODD: u64 = 0x9E37_79B9_7F4A_7C15;
        let fault = self.list[place].fault.number as u64;
        let key = self.seed ^ (fault + 1).wrapping_mul(ODD).rotate_left(32) ^ number.wrapping_mul(ODD);
        Pcg32::seed_from_u64(key)
    }
}

/// The faults of that kind at a port, with their places in the list.
fn of_port(
    list: &[Listed],
    port: usize,
    is_kind: impl Fn(FaultKind) -> bool,
) -> impl Iterator<Item = (usize, &Listed)> {
    list.iter().enumerate().filter(move |(_, listed)| {
        listed.fault.port.is_none_or(|own| own == port) && is_kind(listed.fault.kind)
    })
}

/// A fault that acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct FaultActivation {
    /// Place of the fault in the list.
    pub(crate) place: usize,
    pub(crate) at_ns: u64,
}

#[cfg(test)]
mod tests;
