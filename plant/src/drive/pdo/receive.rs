//! A PDO that the drive receives.

use std::cmp::Ordering;

use masseter_can::CanId;
use masseter_can::canopen::ObjectAddress;
use masseter_shared::clock::MILLISECOND_NS;

use super::EVENT_DRIVEN;
use super::mapping::{MAX_BYTES, Mapped};
use crate::drive::cyclic::NewTargets;
use crate::drive::dictionary::Objects;

/// What is wrong with a PDO that the drive receives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::drive) enum RpdoFault {
    /// Shorter than its mapping: it is not used.
    Short,
    /// Longer than its mapping: what is beyond is not used.
    Long,
    /// Its event timer ran out.
    Overdue,
}

impl RpdoFault {
    pub(in crate::drive) const ALL: [Self; 3] = [Self::Short, Self::Long, Self::Overdue];
}

/// A PDO that the drive receives.
#[derive(Debug, Clone)]
pub(in crate::drive) struct Rpdo {
    id: Option<CanId>,
    is_synchronous: bool,
    deadline_ns: u64,
    mapped: Mapped,
    heard_ns: Option<u64>,
    buffered: Option<[u8; MAX_BYTES]>,
    /// Which of [`RpdoFault::ALL`] it has.
    faults: [bool; RpdoFault::ALL.len()],
    effects: Effects,
}

/// What an RPDO's objects act on.
#[derive(Debug, Clone, Copy)]
pub(in crate::drive) struct Effects {
    /// The cyclic targets: 607A, 6071.
    pub(in crate::drive) targets: NewTargets,
    /// The power: 6040.
    pub(in crate::drive) commands: bool,
    /// How the drive behaves, not only its targets.
    pub(in crate::drive) configures: bool,
}

impl Rpdo {
    /// As configured, nothing received.
    pub(in crate::drive) fn new(objects: &Objects, number: u16) -> Self {
        let (communication, mapping) = (0x1400 + number, 0x1600 + number);
        let mapped = Mapped::of(objects, mapping);
        let holds = |index| mapped.holds(ObjectAddress::new(index, 0));
        Self {
            id: objects.cob_id(communication, 1).identifier(),
            is_synchronous: objects.at(communication, 2) < u32::from(EVENT_DRIVEN),
            deadline_ns: u64::from(objects.at(communication, 5)) * MILLISECOND_NS,
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

    pub(in crate::drive) fn id(&self) -> Option<CanId> {
        self.id
    }

    /// Whether its objects take effect at the next SYNC rather than at once.
    pub(in crate::drive) fn is_synchronous(&self) -> bool {
        self.is_synchronous
    }

    /// Whether what it received waits for a SYNC.
    pub(in crate::drive) fn waits_for_sync(&self) -> bool {
        self.is_synchronous && self.buffered.is_some()
    }

    /// Whether it has that fault.
    pub(in crate::drive) fn has(&self, fault: RpdoFault) -> bool {
        self.faults[fault as usize]
    }

    /// Keeps a frame's data, the newest only.
    pub(in crate::drive) fn take(&mut self, now_ns: u64, data: &[u8]) {
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
        let used = &data[..self.mapped.length];
        let mut buffer = [0; MAX_BYTES];
        buffer[..used.len()].copy_from_slice(used);
        (self.buffered, self.heard_ns) = (Some(buffer), Some(now_ns));
    }

    /// Lets what was received take effect in the dictionary; what else it acts on, if there was anything.
    pub(in crate::drive) fn apply(&mut self, objects: &mut Objects) -> Option<Effects> {
        let data = self.buffered.take()?;
        self.mapped.unpack(data, objects);
        Some(self.effects)
    }

    /// Forgets what was received.
    pub(in crate::drive) fn clear(&mut self) {
        (self.buffered, self.heard_ns) = (None, None);
    }

    /// Lets time pass; whether its event timer ran out just now.
    pub(in crate::drive) fn expires(&mut self, now_ns: u64) -> bool {
        let is_late = |heard_ns: &mut u64| now_ns.saturating_sub(*heard_ns) > self.deadline_ns;
        let expires = self.deadline_ns > 0 && self.heard_ns.take_if(is_late).is_some();
        self.faults[RpdoFault::Overdue as usize] |= expires;
        expires
    }
}
