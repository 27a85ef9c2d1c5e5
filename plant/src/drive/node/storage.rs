//! The stored parameters of a drive (1010h, 1011h): the values that a reset restores.

use crate::drive::dictionary::{Access, ENTRIES, Objects};

/// Objects that command something at once; they are no parameters.
const COMMANDS: [u16; 6] = [0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A];

/// Dictionaries that outlast a reset.
#[derive(Debug, Clone)]
pub(super) struct Storage {
    /// The values that a reset restores.
    pub(super) stored: Objects,
    /// The values of delivery.
    pub(super) factory: Objects,
}

impl Storage {
    /// Stores all parameters (1010h).
    pub(super) fn store(&mut self, objects: &Objects) {
        for (place, entry) in ENTRIES.iter().enumerate() {
            if entry.access == Access::ReadWrite && !COMMANDS.contains(&entry.address.index) {
                self.stored.words[place] = objects.words[place];
            }
        }
    }
}
