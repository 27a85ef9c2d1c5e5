//! The drive's object dictionary: one table, and the memory behind it.
//!
//! The dictionary has type, limits and access of its objects, but not their effects.

mod entry;
pub(crate) mod names;
mod objects;
mod overlay;
mod table;

pub(crate) use entry::{Access, DataType, Entry, Initial, Mapping, MappingEntry, Object, Shape};
pub(crate) use objects::{ENTRIES, Objects, find};
pub(crate) use overlay::Overlay;
pub(crate) use table::{CONSUMED, HISTORY, MAPPED_MAX, OBJECTS, PDOS, RPM_PER_S};
