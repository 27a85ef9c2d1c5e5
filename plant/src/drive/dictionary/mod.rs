//! The drive's object dictionary: one table, and the memory behind it.
//!
//! Nothing here knows what an object does; that is said where it is used.

mod entry;
pub(super) mod names;
mod objects;
mod table;

pub(crate) use entry::{Access, DataType, Entry, Initial, Mapping, Object, Shape};
pub(crate) use objects::{ENTRIES, Objects, find, within_limits, writable};
pub(crate) use table::{HISTORY, IDENTITY, MAPPED_MAX, OBJECTS, PDOS, WATCHED};
