//! The stored parameters of a drive (1010h, 1011h): the values that a reset restores.

use crate::drive::dictionary::{Access, ENTRIES, Objects};

/// Objects that command something at once; they are no parameters.
const COMMANDS: [u16; 6] = [0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A];

/// Dictionaries that outlast a reset.
#[derive(Debug, Clone)]
pub(super) struct Storage {
    /// The values that a reset restores.
    stored: Objects,
    /// The values of delivery.
    factory: Objects,
}

impl Storage {
    /// Nothing stored yet but the values of delivery.
    pub(super) fn new(factory: &Objects) -> Self {
        Self { stored: factory.clone(), factory: factory.clone() }
    }

    /// The values that a reset restores.
    pub(super) fn stored(&self) -> &Objects {
        &self.stored
    }

    /// Stores the values of delivery (1011h).
    pub(super) fn restore_factory(&mut self) {
        self.stored = self.factory.clone();
    }

    /// Stores all parameters (1010h).
    pub(super) fn store(&mut self, objects: &Objects) {
        for (place, entry) in ENTRIES.iter().enumerate() {
            if entry.access == Access::ReadWrite && !COMMANDS.contains(&entry.address.index) {
                self.stored.words[place] = objects.words[place];
            }
        }
    }
}
