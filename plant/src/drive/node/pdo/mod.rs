//! The drive's process data: PDOs as its object dictionary configures them, and the cyclic targets that wait for SYNC.
//!
//! This module copies between frames and the object dictionary. It moves nothing and raises no emergency; it reports
//! [`Effects`] and errors. PDOs are compiled into copies of bytes whenever a parameter changes; the
//! [rules](super::rules) decide which changes are allowed. Remote requests are not answered.

mod mapping;
mod receive;
mod transmit;

use masseter_can::Frame;
use masseter_can::canopen::EmergencyCode;

use super::outbox::Outbox;
use crate::drive::axis::NewTargets;
use crate::drive::dictionary::{Objects, PDOS};
use receive::{ERRORS, Rpdo};
use transmit::Tpdo;

pub(super) use receive::Effects;

/// The PDOs of both directions.
#[derive(Debug, Clone)]
pub(super) struct ProcessData {
    rpdos: [Rpdo; PDOS],
    tpdos: [Tpdo; PDOS],
    /// Cyclic targets written since the last SYNC.
    new_targets: NewTargets,
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
        let number = self.rpdos.iter().position(|rpdo| rpdo.has_id(frame.id()))?;
        self.rpdos[number].take(now_ns, frame.data());
        Some(number)
    }

    /// Each error of process data, and whether any RPDO has it.
    pub(super) fn errors(&self) -> [(EmergencyCode, bool); ERRORS.len()] {
        std::array::from_fn(|error| (ERRORS[error], self.rpdos.iter().any(|rpdo| rpdo.errors()[error])))
    }

    /// Whether the event timer of an RPDO has just run out. Outside of operational no timer runs.
    pub(super) fn expires(&mut self, now_ns: u64) -> bool {
        self.rpdos.iter_mut().fold(false, |any, rpdo| rpdo.expires(now_ns) | any)
    }

    /// Whether the data of an RPDO take effect at the next SYNC instead of at once.
    pub(super) fn is_synchronous(&self, number: usize) -> bool {
        self.rpdos[number].is_synchronous()
    }

    /// Writes the received data of an RPDO into the dictionary; returns their other effects, if there were data.
    pub(super) fn apply(&mut self, number: usize, objects: &mut Objects) -> Option<Effects> {
        self.rpdos[number].apply(objects)
    }

    /// Adds cyclic targets that wait for SYNC.
    pub(super) fn add_targets(&mut self, targets: NewTargets) {
        self.new_targets.position |= targets.position;
        self.new_targets.torque |= targets.torque;
    }

    /// The cyclic targets written since the last SYNC.
    pub(super) fn take_targets(&mut self) -> NewTargets {
        std::mem::take(&mut self.new_targets)
    }

    /// An RPDO has new parameters.
    pub(super) fn configure_rpdo(&mut self, number: usize, objects: &Objects) {
        self.rpdos[number] = Rpdo::new(objects, number);
    }

    /// A TPDO has new parameters.
    pub(super) fn configure_tpdo(&mut self, number: usize, objects: &Objects) {
        self.tpdos[number] = Tpdo::new(objects, number);
    }

    /// Whether any TPDO is sent at events instead of SYNC.
    pub(super) fn is_event_driven(&self) -> bool {
        self.tpdos.iter().any(Tpdo::is_event_driven)
    }

    /// The TPDOs count as not sent.
    pub(super) fn forget_sent(&mut self) {
        self.tpdos.iter_mut().for_each(Tpdo::clear);
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
