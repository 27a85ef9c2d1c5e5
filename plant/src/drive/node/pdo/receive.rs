//! A receive PDO: its buffer, its event timer and its errors.

use std::cmp::Ordering;

use masseter_can::CanId;
use masseter_can::canopen::{CobId, EmergencyCode};
use masseter_runtime::clock::MILLISECOND_NS;

use super::mapping::{EVENT_DRIVEN, MAX_BYTES, Mapped};
use crate::drive::axis::NewTargets;
use crate::drive::dictionary::Objects;

/// The errors of a receive PDO: shorter than its mapping, so that its data are discarded; longer than its mapping, so that
/// the bytes beyond are discarded; its event timer ran out.
pub(crate) const ERRORS: [EmergencyCode; 3] =
    [EmergencyCode::PDO_LENGTH, EmergencyCode::PDO_LENGTH_EXCEEDED, EmergencyCode::RPDO_TIMEOUT];
const SHORT: usize = 0;
const LONG: usize = 1;
const OVERDUE: usize = 2;

/// A receive PDO.
#[derive(Debug, Clone)]
pub(crate) struct Rpdo {
    /// Its identifier; none where the PDO does not exist.
    id: Option<CanId>,
    /// Whether its data take effect at the next SYNC instead of at once.
    is_synchronous: bool,
    deadline_ns: u64,
    mapped: Mapped,
    heard_ns: Option<u64>,
    buffered: Option<[u8; MAX_BYTES]>,
    /// Which of [`ERRORS`] it has.
    has: [bool; ERRORS.len()],
    effects: Effects,
}

/// Effects of written objects beyond the dictionary.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Effects {
    /// Cyclic targets (607Ah, 6071h).
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
                // They take effect with the next target, so that an old target moves nothing.
                0x60B0..=0x60B2 => {}
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

    /// Whether frames with that identifier are its.
    pub(crate) fn has_id(&self, id: CanId) -> bool {
        self.id == Some(id)
    }

    /// Whether its data take effect at the next SYNC instead of at once.
    pub(crate) fn is_synchronous(&self) -> bool {
        self.is_synchronous
    }

    /// Which of [`ERRORS`] it has.
    pub(crate) fn errors(&self) -> [bool; ERRORS.len()] {
        self.has
    }

    /// Buffers a frame's data; only the newest are kept.
    pub(crate) fn take(&mut self, now_ns: u64, data: &[u8]) {
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
