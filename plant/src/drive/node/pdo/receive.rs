//! A receive PDO: its buffer, its event timer and its errors.

use std::cmp::Ordering;

use masseter_can::CanId;
use masseter_can::canopen::{EmergencyCode, ObjectAddress};
use masseter_shared::clock::MILLISECOND_NS;

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
    id: Option<CanId>,
    is_synchronous: bool,
    deadline_ns: u64,
    mapped: Mapped,
    heard_ns: Option<u64>,
    buffered: Option<[u8; MAX_BYTES]>,
    /// Which of [`ERRORS`] it has.
    pub(crate) has: [bool; ERRORS.len()],
    effects: Effects,
}

/// Effects of an RPDO's objects beyond the dictionary.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Effects {
    /// Cyclic targets (607Ah, 6071h).
    pub(crate) targets: NewTargets,
    /// Power states (6040h).
    pub(crate) commands: bool,
    /// Configuration of the axis (6060h, 6081h, 6083h, 6084h).
    pub(crate) configures: bool,
}

impl Rpdo {
    /// The configured PDO, nothing received yet.
    pub(crate) fn new(objects: &Objects, number: u16) -> Self {
        let (communication, mapping) = (0x1400 + number, 0x1600 + number);
        let mapped = Mapped::compile(objects, mapping);
        let holds = |index| mapped.holds(ObjectAddress::new(index, 0));
        Self {
            id: objects.cob_id(communication, 1).identifier(),
            is_synchronous: objects.at(communication, 2) < u32::from(EVENT_DRIVEN),
            deadline_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
            mapped,
            heard_ns: None,
            buffered: None,
            has: [false; ERRORS.len()],
            effects: Effects {
                targets: NewTargets { position: holds(0x607A), torque: holds(0x6071) },
                commands: holds(0x6040),
                configures: [0x6060, 0x6081, 0x6083, 0x6084].into_iter().any(holds),
            },
        }
    }

    /// Its identifier; none where the PDO does not exist.
    pub(crate) fn id(&self) -> Option<CanId> {
        self.id
    }

    /// Whether its data take effect at the next SYNC instead of at once.
    pub(crate) fn is_synchronous(&self) -> bool {
        self.is_synchronous
    }

    /// Buffers a frame's data; only the newest are kept.
    pub(crate) fn take(&mut self, now_ns: u64, data: &[u8]) {
        match data.len().cmp(&self.mapped.length) {
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
        let used = &data[..self.mapped.length];
        let mut buffer = [0; MAX_BYTES];
        buffer[..used.len()].copy_from_slice(used);
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
