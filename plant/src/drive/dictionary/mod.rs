//! The drive's object dictionary: one table, and the memory behind it.
//!
//! The dictionary has type, limits and access of its objects, but not their effects.

mod entry;
pub(super) mod names;
mod objects;
mod table;

pub(crate) use entry::{Access, DataType, Entry, Initial, Mapping, MappingEntry, Object, Shape};
pub(crate) use objects::{ENTRIES, Objects, find};
pub(crate) use table::{CONSUMED, HISTORY, MAPPED_MAX, OBJECTS, PDOS};
