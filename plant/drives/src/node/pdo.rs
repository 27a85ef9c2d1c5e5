//! The drive's process data: PDOs by the object dictionary, and the cyclic targets that wait for SYNC.
//!
//! This module copies between frames and the object dictionary, and reports [`Effects`] and errors. It moves nothing,
//! raises no emergency and answers no remote requests. A change of a parameter compiles the PDOs into copies of bytes;
//! the rules of [access](super::access) decide the allowed changes.

use std::{cmp::Ordering, collections::VecDeque};

use arrayvec::ArrayVec;
use masseter_can::canopen::{CobId, EmergencyCode};
use masseter_can::{CanId, Frame};

use crate::dictionary::{ENTRIES, Objects};
use crate::table::{MAPPED_MAX, PDOS};
use crate::{MILLISECOND_NS, axis::motion::NewTargets};

/// The PDOs of both directions.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct ProcessData {
    pub(super) rpdos: [Rpdo; PDOS],
    pub(super) tpdos: [Tpdo; PDOS],
    /// Cyclic targets written since the last SYNC.
    pub(super) new_targets: NewTargets,
}

impl ProcessData {
    /// The PDOs that the dictionary configures.
    pub(super) fn new(objects: &Objects) -> Self {
        Self {
            rpdos: std::array::from_fn(|number| Rpdo::new(objects, number)),
            tpdos: std::array::from_fn(|number| Tpdo::new(objects, number)),
            new_targets: NewTargets::default(),
        }
    }

    /// Buffers the data of a frame; returns the number of its RPDO.
    pub(super) fn receive(&mut self, now_ns: u64, frame: &Frame) -> Option<usize> {
        let number = self.rpdos.iter().position(|rpdo| rpdo.id == Some(frame.id()))?;
        self.rpdos[number].take_data(now_ns, frame.data());
        Some(number)
    }

    /// Each error of process data, and whether any RPDO has it.
    pub(super) fn errors(&self) -> [(EmergencyCode, bool); ERRORS.len()] {
        std::array::from_fn(|error| (ERRORS[error], self.rpdos.iter().any(|rpdo| rpdo.has[error])))
    }

    /// Whether the event timer of an RPDO has just run out. Outside of operational no timer runs.
    pub(super) fn expires(&mut self, now_ns: u64) -> bool {
        self.rpdos.iter_mut().fold(false, |any, rpdo| rpdo.expires(now_ns) | any)
    }

    /// Adds cyclic targets that wait for SYNC.
    pub(super) fn add_targets(&mut self, targets: NewTargets) {
        self.new_targets.position |= targets.position;
        self.new_targets.torque |= targets.torque;
        self.new_targets.velocity |= targets.velocity;
    }

    /// Whether any TPDO is sent at events instead of SYNC.
    pub(super) fn is_event_driven(&self) -> bool {
        self.tpdos.iter().any(Tpdo::is_event_driven)
    }

    /// Discards the received data.
    pub(super) fn discard_received(&mut self) {
        self.rpdos.iter_mut().for_each(Rpdo::clear);
        self.new_targets = NewTargets::default();
    }

    /// Sends the TPDOs that are due.
    pub(super) fn send(&mut self, outbox: &mut Outbox, due: impl FnMut(&mut Tpdo) -> Option<Frame>) {
        self.tpdos.iter_mut().filter_map(due).for_each(|frame| outbox.add(frame));
    }
}

/// The lowest transmission type that SYNC does not trigger.
pub(super) const EVENT_DRIVEN: u8 = 254;
/// Most bytes of a PDO of the drive, for every format of its frames.
pub(super) const MAX_BYTES: usize = Frame::MAX_DATA;

/// A mapped object: its place in the dictionary and its length.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Part {
    place: usize,
    bits: u32,
}

impl Part {
    fn index(self) -> u16 {
        ENTRIES[self.place].address.index
    }

    /// The bits of a word that are mapped.
    fn mask(self) -> u32 {
        u32::MAX >> (u32::BITS - self.bits)
    }
}

/// A compiled mapping.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Mapped(ArrayVec<Part, MAPPED_MAX>);

impl Mapped {
    /// Compiles the mapping parameter of that index.
    pub(super) fn compile(objects: &Objects, index: u16) -> Self {
        let part = |place: usize| Part { place, bits: 8 * ENTRIES[place].kind.bytes() as u32 };
        Self(objects.mapped_places(index).map(part).collect())
    }

    /// Keeps the objects of those indices only.
    pub(super) fn retain(&mut self, keeps: impl Fn(u16) -> bool) {
        self.0.retain(|part| keeps(part.index()));
    }

    /// Bytes of the data.
    pub(super) fn length(&self) -> usize {
        self.0.iter().map(|part| part.bits as usize / 8).sum()
    }

    /// The indices of the mapped objects.
    pub(super) fn indices(&self) -> impl Iterator<Item = u16> {
        self.0.iter().map(|part| part.index())
    }

    /// The data of the objects, followed by zeros.
    pub(super) fn pack(&self, objects: &Objects) -> [u8; MAX_BYTES] {
        let (mut data, mut at) = (0, 0);
        for part in &self.0 {
            data |= u64::from(objects.words[part.place] & part.mask()) << at;
            at += part.bits;
        }
        data.to_le_bytes()
    }

    /// Writes the data into the objects; a value beyond its limits leaves its object as it is.
    pub(super) fn unpack(&self, data: [u8; MAX_BYTES], objects: &mut Objects) {
        let mut data = u64::from_le_bytes(data);
        for part in &self.0 {
            let word = data as u32 & part.mask();
            if ENTRIES[part.place].check_limits(word).is_ok() {
                objects.words[part.place] = word;
            }
            data >>= part.bits;
        }
    }
}

/// The errors of a receive PDO. A PDO shorter than its mapping loses its data; a longer PDO loses the bytes beyond. The
/// third error is the end of the event timer.
pub(crate) const ERRORS: [EmergencyCode; 3] =
    [EmergencyCode::PDO_LENGTH, EmergencyCode::PDO_LENGTH_EXCEEDED, EmergencyCode::RPDO_TIMEOUT];
const SHORT: usize = 0;
const LONG: usize = 1;
const OVERDUE: usize = 2;

/// A receive PDO.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Rpdo {
    /// Its identifier; `None` if the PDO does not exist.
    id: Option<CanId>,
    /// Whether its data take effect at the next SYNC instead of at once.
    pub(super) is_synchronous: bool,
    deadline_ns: u64,
    mapped: Mapped,
    heard_ns: Option<u64>,
    buffered: Option<[u8; MAX_BYTES]>,
    /// Which of [`ERRORS`] it has.
    has: [bool; ERRORS.len()],
    effects: Effects,
}

/// Effects of written objects beyond the dictionary.
#[derive(Debug, Clone, Copy, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Effects {
    /// Targets (607Ah, 6071h, 60FFh).
    pub(crate) targets: NewTargets,
    /// Power states (6040h).
    pub(crate) commands: bool,
    /// Configuration of the axis (the other objects of the profile).
    pub(crate) configures: bool,
}

impl Effects {
    /// The effects of the objects with those indices.
    pub(crate) fn of(indices: impl IntoIterator<Item = u16>) -> Self {
        let mut effects = Self::default();
        for index in indices {
            match index {
                0x6040 => effects.commands = true,
                0x6071 => effects.targets.torque = true,
                0x607A => effects.targets.position = true,
                // Offsets take effect with the next target, so that an old target moves nothing.
                0x60B0..=0x60B2 => {}
                0x60FF => effects.targets.velocity = true,
                0x6000.. => effects.configures = true,
                _ => {}
            }
        }
        effects
    }
}

impl Rpdo {
    /// The configured PDO, nothing received yet.
    pub(crate) fn new(objects: &Objects, number: usize) -> Self {
        let (communication, mapping) = (0x1400 + number as u16, 0x1600 + number as u16);
        let mapped = Mapped::compile(objects, mapping);
        Self {
            id: CobId(objects.at(communication, 1)).identifier(),
            is_synchronous: objects.at(communication, 2) < u32::from(EVENT_DRIVEN),
            deadline_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
            effects: Effects::of(mapped.indices()),
            mapped,
            heard_ns: None,
            buffered: None,
            has: [false; ERRORS.len()],
        }
    }

    /// Buffers a frame's data; only the newest are kept.
    pub(crate) fn take_data(&mut self, now_ns: u64, data: &[u8]) {
        let length = self.mapped.length();
        match data.len().cmp(&length) {
            Ordering::Less => {
                self.has[SHORT] = true;
                return;
            }
            Ordering::Equal => self.has = Default::default(),
            Ordering::Greater => {
                self.has[LONG] = true;
                self.has[OVERDUE] = false;
            }
        }
        let mut buffer = [0; MAX_BYTES];
        buffer[..length].copy_from_slice(&data[..length]);
        (self.buffered, self.heard_ns) = (Some(buffer), Some(now_ns));
    }

    /// Writes the received data into the dictionary; returns their other effects, if there were data.
    pub(crate) fn apply(&mut self, objects: &mut Objects) -> Option<Effects> {
        let data = self.buffered.take()?;
        self.mapped.unpack(data, objects);
        Some(self.effects)
    }

    /// Discards the received data.
    pub(crate) fn clear(&mut self) {
        (self.buffered, self.heard_ns) = (None, None);
    }

    /// Whether the event timer has just run out.
    pub(crate) fn expires(&mut self, now_ns: u64) -> bool {
        let is_late = |heard_ns: &mut u64| now_ns.saturating_sub(*heard_ns) > self.deadline_ns;
        let expires = self.deadline_ns > 0 && self.heard_ns.take_if(is_late).is_some();
        self.has[OVERDUE] |= expires;
        expires
    }
}

/// Unit of an inhibit time, ns.
const INHIBIT_UNIT_NS: u64 = MILLISECOND_NS / 10;
/// Objects that change with every sample. As in most drives their change is no event, because noise alone would fill
/// the bus. The event timer (1800h:5) sends these objects.
const SAMPLED: [u16; 6] = [0x6062, 0x6063, 0x6064, 0x606C, 0x6077, 0x60F4];

/// The condition for sending a TPDO.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
enum Trigger {
    /// At the next SYNC after a change.
    ChangeThenSync,
    /// At every n-th SYNC, beginning with one that has the start value as its counter (0: any).
    EverySync { every: u8, start: u8 },
    /// At a change, and at the latest after the event timer.
    Event,
}

/// A transmit PDO.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(crate) struct Tpdo {
    id: Option<CanId>,
    trigger: Trigger,
    inhibit_ns: u64,
    timer_ns: u64,
    mapped: Mapped,
    /// The objects whose change triggers transmission.
    watched: Mapped,
    /// SYNCs since the last transmission; none before the start value.
    syncs: Option<u8>,
    /// Data of the watched objects at the last transmission, and its time.
    sent: Option<([u8; MAX_BYTES], u64)>,
}

impl Tpdo {
    /// The configured PDO, nothing sent yet.
    pub(crate) fn new(objects: &Objects, number: usize) -> Self {
        let (communication, mapping) = (0x1800 + number as u16, 0x1A00 + number as u16);
        let start = objects.at(communication, 6) as u8;
        let mapped = Mapped::compile(objects, mapping);
        let trigger = match objects.at(communication, 2) as u8 {
            0 => Trigger::ChangeThenSync,
            every if every < EVENT_DRIVEN => Trigger::EverySync { every, start },
            _ => Trigger::Event,
        };
        let mut watched = mapped.clone();
        if trigger == Trigger::Event {
            watched.retain(|index| !SAMPLED.contains(&index));
        }
        Self {
            id: CobId(objects.at(communication, 1)).identifier(),
            trigger,
            inhibit_ns: u64::from(objects.at(communication, 3)) * INHIBIT_UNIT_NS,
            timer_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
            mapped,
            watched,
            syncs: None,
            sent: None,
        }
    }

    /// Whether the PDO exists and is sent at events instead of SYNC.
    pub(crate) fn is_event_driven(&self) -> bool {
        self.id.is_some() && self.trigger == Trigger::Event
    }

    /// Restarts transmission, as when the node becomes operational.
    pub(crate) fn clear(&mut self) {
        (self.syncs, self.sent) = (None, None);
    }

    /// The frame due at a SYNC of that counter (0 where SYNC has none).
    pub(crate) fn at_sync(&mut self, now_ns: u64, counter: u8, objects: &Objects) -> Option<Frame> {
        let id = self.id?;
        match self.trigger {
            Trigger::Event => None,
            Trigger::ChangeThenSync => self.frame_of_change(id, now_ns, objects),
            Trigger::EverySync { every, start } => {
                let syncs = match self.syncs {
                    None if counter != 0 && start != 0 && counter != start => return None,
                    None => every,
                    Some(syncs) => syncs + 1,
                };
                self.syncs = Some(if syncs >= every { 0 } else { syncs });
                if syncs >= every { self.frame(id, objects) } else { None }
            }
        }
    }

    /// The frame due because of an event.
    pub(crate) fn at_event(&mut self, now_ns: u64, objects: &Objects) -> Option<Frame> {
        let id = self.id.filter(|_| self.is_event_driven())?;
        let since_ns = self.sent.map(|(_, sent_ns)| now_ns.saturating_sub(sent_ns));
        if since_ns.is_some_and(|since_ns| since_ns < self.inhibit_ns) {
            return None;
        }
        let is_due = self.timer_ns > 0 && since_ns.is_some_and(|since_ns| since_ns >= self.timer_ns);
        if is_due {
            self.sent = None;
        }
        self.frame_of_change(id, now_ns, objects)
    }

    /// The frame, if a watched object has changed since the last transmission.
    fn frame_of_change(&mut self, id: CanId, now_ns: u64, objects: &Objects) -> Option<Frame> {
        let watched = self.watched.pack(objects);
        if self.sent.is_some_and(|(sent, _)| sent == watched) {
            return None;
        }
        self.sent = Some((watched, now_ns));
        self.frame(id, objects)
    }

    fn frame(&self, id: CanId, objects: &Objects) -> Option<Frame> {
        let data = self.mapped.pack(objects);
        Frame::new(id, &data[..self.mapped.length()]).ok()
    }
}

/// Boot-up or heartbeat, four TPDOs, an SDO answer and emergencies.
const CAPACITY: usize = 12;

/// The frames.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Outbox(pub(super) VecDeque<Frame>);

impl Outbox {
    /// No frames, with room for the most.
    pub(super) fn new() -> Self {
        Self(VecDeque::with_capacity(CAPACITY))
    }

    /// Adds a frame. Without room the frame is lost, as in a node whose transmit queue is full.
    pub(super) fn add(&mut self, frame: Frame) {
        if self.0.len() < CAPACITY {
            self.0.push_back(frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::CanId;

    use super::*;

    #[test]
    fn frames_leave_in_their_order_and_the_last_ones_have_no_room() {
        let frame = |number: u8| Frame::fixed(CanId::standard(1).unwrap(), [number]);
        let mut outbox = Outbox::new();
        for round in 0..3 {
            (0..20).for_each(|number| outbox.add(frame(number)));
            let left: Vec<_> = std::iter::from_fn(|| outbox.0.pop_front()).collect();
            assert_eq!(left, (0..CAPACITY as u8).map(frame).collect::<Vec<_>>(), "round {round}");
        }
    }
}
