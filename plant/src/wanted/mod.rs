//! The objects of a drive as the rig needs them, from scenario and profile: once for the boot of a run, for inspection and
//! for configuration.
//!
//! Nothing here talks to a drive.

mod drive;
mod known;
mod object;
mod objects;
mod process_data;

pub use drive::WantedDrive;
pub use object::WantedObject;
pub(crate) use object::{OFFSETS, may_keep, shown_bits};
pub(crate) use process_data::{COB_ID_BITS, OTHER_PDOS};
pub use process_data::{WantedIdentity, WantedPdo};
