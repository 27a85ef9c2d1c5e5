//! Process data of the drive: PDOs as its object dictionary configures them, compiled into copies of
//! bytes whenever a parameter changes.
//!
//! Which changes are allowed is said in [`rules`](super::rules). Remote requests are not answered.

mod mapping;
mod receive;
mod transmit;

use masseter_shared::can::CanId;
use masseter_shared::can::canopen::{COB_ID_NOT_VALID, ObjectAddress};

use super::dictionary::{Objects, find};

pub(crate) use mapping::MappingEntry;
pub(super) use receive::{Rpdo, RpdoFault};
pub(super) use transmit::Tpdo;

/// The lowest transmission type that SYNC does not drive.
const EVENT_DRIVEN: u8 = 254;

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
