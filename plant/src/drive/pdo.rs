//! Process data of the drive: PDOs as its object dictionary configures them, compiled into copies of
//! bytes whenever a parameter changes.
//!
//! Which changes are allowed is said in [`rules`](super::rules). Remote requests are not answered.

use std::cmp::Ordering;

use masseter_shared::can::canopen::{COB_ID_NOT_VALID, ObjectAddress};
use masseter_shared::can::{CanId, Frame};
use masseter_shared::clock::MILLISECOND_NS;

use super::cyclic::NewTargets;
use super::dictionary::{ENTRIES, MAPPED_MAX, Objects, find, within_limits};

/// The lowest transmission type that SYNC does not drive.
const EVENT_DRIVEN: u8 = 254;
/// Unit of an inhibit time, ns.
const INHIBIT_UNIT_NS: u64 = 100_000;
/// Objects that change with every sample. As in most drives that is no event, or their noise alone would fill the bus:
/// the event timer (1800:5) sends them.
const SAMPLED: [u16; 5] = [0x6062, 0x6064, 0x606C, 0x6077, 0x60F4];

/// A word of a PDO's parameters.
fn parameter(objects: &Objects, index: u16, subindex: u8) -> u32 {
    let place = find(ObjectAddress::new(index, subindex)).expect("every PDO has this parameter");
    objects.word(place)
}

/// The identifier of a PDO that exists.
fn identifier(cob_id: u32) -> Option<CanId> {
    if cob_id & COB_ID_NOT_VALID != 0 {
        return None;
    }
    CanId::standard((cob_id & 0x7FF) as u16).ok()
}

/// An object of the mapping: where its word is, and how many of its bytes are meant.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    place: u16,
    bytes: u8,
}

impl Part {
    fn address(self) -> ObjectAddress {
        ENTRIES[usize::from(self.place)].address
    }
}

/// A compiled mapping.
#[derive(Debug, Clone, Copy, Default)]
struct Mapped {
    parts: [Part; MAPPED_MAX],
    count: usize,
    length: usize,
}

impl Mapped {
    fn of(objects: &Objects, index: u16) -> Self {
        let mut mapped = Self { count: parameter(objects, index, 0) as usize, ..Self::default() };
        for place in 0..mapped.count {
            let entry = MappingEntry(parameter(objects, index, place as u8 + 1));
            let object = find(entry.object()).expect("only what exists can be mapped");
            let bytes = ENTRIES[object].entry.kind.bytes();
            mapped.parts[place] = Part { place: object as u16, bytes: bytes as u8 };
            mapped.length += bytes;
        }
        mapped
    }

    /// Only the objects whose change is an event.
    fn events(&self) -> Self {
        let mut events = Self::default();
        for part in self.parts().iter().filter(|part| !SAMPLED.contains(&part.address().index)) {
            events.parts[events.count] = *part;
            events.count += 1;
            events.length += usize::from(part.bytes);
        }
        events
    }

    fn parts(&self) -> &[Part] {
        &self.parts[..self.count]
    }

    fn holds(&self, object: ObjectAddress) -> bool {
        self.parts().iter().any(|part| part.address() == object)
    }

    fn pack(&self, objects: &Objects) -> [u8; Frame::MAX_DATA] {
        let mut data = [0; Frame::MAX_DATA];
        let mut at = 0;
        for part in self.parts() {
            let bytes = usize::from(part.bytes);
            let word = objects.word(usize::from(part.place)).to_le_bytes();
            data[at..at + bytes].copy_from_slice(&word[..bytes]);
            at += bytes;
        }
        data
    }

    /// Writes the data into the objects; a value beyond its limits leaves its object as it is.
    fn unpack(&self, data: [u8; Frame::MAX_DATA], objects: &mut Objects) {
        let mut at = 0;
        for part in self.parts() {
            let bytes = usize::from(part.bytes);
            let mut word = [0; 4];
            word[..bytes].copy_from_slice(&data[at..at + bytes]);
            let (place, word) = (usize::from(part.place), u32::from_le_bytes(word));
            if within_limits(place, word).is_ok() {
                objects.set_word(place, word);
            }
            at += bytes;
        }
    }
}

/// An entry of a mapping parameter: index, sub-index and length in bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct MappingEntry(pub(crate) u32);

impl MappingEntry {
    pub(crate) const fn object(self) -> ObjectAddress {
        ObjectAddress::new((self.0 >> 16) as u16, (self.0 >> 8) as u8)
    }

    pub(crate) const fn bits(self) -> usize {
        (self.0 & 0xFF) as usize
    }
}

/// What is wrong with a PDO that the drive receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum RpdoFault {
    /// Shorter than its mapping: it is not used.
    Short,
    /// Longer than its mapping: what is beyond is not used.
    Long,
    /// Its event timer ran out.
    Overdue,
}

impl RpdoFault {
    pub(super) const ALL: [Self; 3] = [Self::Short, Self::Long, Self::Overdue];
}

/// A PDO that the drive receives.
#[derive(Debug, Clone)]
pub(super) struct Rpdo {
    id: Option<CanId>,
    is_synchronous: bool,
    deadline_ns: u64,
    mapped: Mapped,
    heard_ns: Option<u64>,
    buffered: Option<[u8; Frame::MAX_DATA]>,
    /// Which of [`RpdoFault::ALL`] it has.
    faults: [bool; RpdoFault::ALL.len()],
    effects: Effects,
}

/// What an RPDO's objects act on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effects {
    /// The cyclic targets: 607A, 6071.
    pub(super) targets: NewTargets,
    /// The power: 6040.
    pub(super) commands: bool,
    /// How the drive behaves, not only its targets.
    pub(super) configures: bool,
}

impl Rpdo {
    /// As configured, nothing received.
    pub(super) fn new(objects: &Objects, number: u16) -> Self {
        let (communication, mapping) = (0x1400 + number, 0x1600 + number);
        let mapped = Mapped::of(objects, mapping);
        let holds = |index| mapped.holds(ObjectAddress::new(index, 0));
        Self {
            id: identifier(parameter(objects, communication, 1)),
            is_synchronous: parameter(objects, communication, 2) < u32::from(EVENT_DRIVEN),
            deadline_ns: u64::from(parameter(objects, communication, 5)) * MILLISECOND_NS,
            mapped,
            heard_ns: None,
            buffered: None,
            faults: [false; RpdoFault::ALL.len()],
            effects: Effects {
                targets: NewTargets { position: holds(0x607A), torque: holds(0x6071) },
                commands: holds(0x6040),
                configures: [0x6060, 0x6081, 0x6083, 0x6084].into_iter().any(holds),
            },
        }
    }

    pub(super) fn id(&self) -> Option<CanId> {
        self.id
    }

    /// Whether its objects take effect at the next SYNC rather than at once.
    pub(super) fn is_synchronous(&self) -> bool {
        self.is_synchronous
    }

    /// Whether what it received waits for a SYNC.
    pub(super) fn waits_for_sync(&self) -> bool {
        self.is_synchronous && self.buffered.is_some()
    }

    /// Whether it has that fault.
    pub(super) fn has(&self, fault: RpdoFault) -> bool {
        self.faults[fault as usize]
    }

    /// Keeps a frame's data, the newest only.
    pub(super) fn take(&mut self, now_ns: u64, data: &[u8]) {
        match data.len().cmp(&self.mapped.length) {
            Ordering::Less => {
                self.faults[RpdoFault::Short as usize] = true;
                return;
            }
            Ordering::Equal => self.faults = Default::default(),
            Ordering::Greater => {
                self.faults[RpdoFault::Long as usize] = true;
                self.faults[RpdoFault::Overdue as usize] = false;
            }
        }
        let mut buffer = [0; Frame::MAX_DATA];
        buffer[..data.len()].copy_from_slice(data);
        (self.buffered, self.heard_ns) = (Some(buffer), Some(now_ns));
    }

    /// Lets what was received take effect in the dictionary; what else it acts on, if there was anything.
    pub(super) fn apply(&mut self, objects: &mut Objects) -> Option<Effects> {
        let data = self.buffered.take()?;
        self.mapped.unpack(data, objects);
        Some(self.effects)
    }

    /// Forgets what was received.
    pub(super) fn clear(&mut self) {
        (self.buffered, self.heard_ns) = (None, None);
    }

    /// Lets time pass; whether its event timer ran out just now.
    pub(super) fn expires(&mut self, now_ns: u64) -> bool {
        let is_late = |heard_ns: &mut u64| now_ns.saturating_sub(*heard_ns) > self.deadline_ns;
        let expires = self.deadline_ns > 0 && self.heard_ns.take_if(is_late).is_some();
        self.faults[RpdoFault::Overdue as usize] |= expires;
        expires
    }
}

/// When a TPDO is sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trigger {
    /// At the next SYNC after a change.
    ChangeThenSync,
    /// At every so many SYNCs, beginning with one whose counter is that (0: any).
    EverySync { every: u8, start: u8 },
    /// At a change, and at the latest after the event timer.
    Event,
}

/// A PDO that the drive transmits.
#[derive(Debug, Clone)]
pub(super) struct Tpdo {
    id: Option<CanId>,
    trigger: Trigger,
    inhibit_ns: u64,
    timer_ns: u64,
    mapped: Mapped,
    /// The objects whose change has it sent.
    watched: Mapped,
    /// SYNCs since it was sent last; `None` until the start value came.
    syncs: Option<u8>,
    /// What the watched objects were when it was sent last, and when.
    sent: Option<([u8; Frame::MAX_DATA], u64)>,
}

impl Tpdo {
    /// As configured, nothing sent.
    pub(super) fn new(objects: &Objects, number: u16) -> Self {
        let (communication, mapping) = (0x1800 + number, 0x1A00 + number);
        let start = parameter(objects, communication, 6) as u8;
        let mapped = Mapped::of(objects, mapping);
        let trigger = match parameter(objects, communication, 2) as u8 {
            0 => Trigger::ChangeThenSync,
            every if every < EVENT_DRIVEN => Trigger::EverySync { every, start },
            _ => Trigger::Event,
        };
        Self {
            id: identifier(parameter(objects, communication, 1)),
            trigger,
            inhibit_ns: u64::from(parameter(objects, communication, 3)) * INHIBIT_UNIT_NS,
            timer_ns: u64::from(parameter(objects, communication, 5)) * MILLISECOND_NS,
            watched: if trigger == Trigger::Event { mapped.events() } else { mapped },
            mapped,
            syncs: None,
            sent: None,
        }
    }

    /// Whether it exists and is sent at events rather than at SYNC.
    pub(super) fn is_event_driven(&self) -> bool {
        self.id.is_some() && self.trigger == Trigger::Event
    }

    /// Begins anew, as when the node becomes operational.
    pub(super) fn clear(&mut self) {
        (self.syncs, self.sent) = (None, None);
    }

    /// The frame to send at a SYNC of that counter (0 where SYNC has none).
    pub(super) fn at_sync(&mut self, now_ns: u64, counter: u8, objects: &Objects) -> Option<Frame> {
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

    /// The frame to send because of an event.
    pub(super) fn at_event(&mut self, now_ns: u64, objects: &Objects) -> Option<Frame> {
        let id = self.id.filter(|_| self.is_event_driven())?;
        let since_ns = self.sent.map(|(_, sent_ns)| now_ns.saturating_sub(sent_ns));
        let is_inhibited = since_ns.is_some_and(|since_ns| since_ns < self.inhibit_ns);
        let is_due = self.timer_ns > 0 && since_ns.is_some_and(|since_ns| since_ns >= self.timer_ns);
        if is_due {
            self.sent = None;
        }
        if is_inhibited { None } else { self.frame_of_change(id, now_ns, objects) }
    }

    /// The frame, if a watched object is not what it was when it was sent last.
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
        Frame::new(id, &data[..self.mapped.length]).ok()
    }
}
