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
use receive::ERRORS;

pub(super) use receive::{Effects, Rpdo};
pub(super) use transmit::Tpdo;

/// The PDOs of both directions.
#[derive(Debug, Clone)]
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
        self.rpdos[number].take(now_ns, frame.data());
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
