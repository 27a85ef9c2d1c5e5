//! Process data of the drive: PDOs as its object dictionary configures them, compiled into copies of
//! bytes whenever a parameter changes.
//!
//! Which changes are allowed is said in [`rules`](super::rules). Remote requests are not answered.

mod mapping;
mod receive;
mod transmit;

pub(crate) use mapping::MappingEntry;
pub(super) use receive::{Rpdo, RpdoFault};
pub(super) use transmit::Tpdo;

/// The lowest transmission type that SYNC does not drive.
const EVENT_DRIVEN: u8 = 254;
