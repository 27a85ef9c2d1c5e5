//! The address of an entry of the object dictionary.

use std::fmt;

/// Index and sub-index (the "multiplexer" of CiA 301).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ObjectAddress {
    /// Index.
    pub index: u16,
    /// Sub-index; 0 for an object without any.
    pub subindex: u8,
}

impl ObjectAddress {
    /// The entry of that index and sub-index.
    pub const fn new(index: u16, subindex: u8) -> Self {
        Self { index, subindex }
    }
}

impl fmt::Display for ObjectAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}h:{:02X}h", self.index, self.subindex)
    }
}
