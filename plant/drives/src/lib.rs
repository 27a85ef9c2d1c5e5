#![doc = include_str!("../README.md")]

mod axis;
mod dictionary;
mod eds;
mod faults;
mod memory;
mod names;
mod node;
mod quirks;
mod ratings;
mod settings;
mod stand;
mod table;
#[cfg(test)]
mod tests;

pub use axis::drivetrain::HeldMean;
pub use axis::encoder::Look;
pub use dictionary::{Objects, entry};
pub use eds::{eds, object_lists};
pub use faults::{DriveFault, DriveFaults};
pub use memory::{DriveMemory, MemoryError};
pub use node::DriveNode;
pub use quirks::Quirk;
pub use ratings::Ratings;
pub use settings::{DriveSettings, Identity, SettingsError};
pub use stand::{Encoder, Mass, Stand};
pub use table::{Access, DataType, Entry, INCREMENTS_PER_TURN, Mapping, PDOS};

/// Nanoseconds of a millisecond and of a second.
const MILLISECOND_NS: u64 = 1_000_000;
const SECOND_NS: u64 = 1_000_000_000;
