//! The stored parameters of a drive (1010h, 1011h): the values that a reset restores.

use crate::drive::dictionary::{Access, ENTRIES, Objects, names};

/// Objects that command something at once; they are no parameters.
const COMMANDS: [u16; 9] = [0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2];
/// 1010h:01 while the drive saves, and when it can be asked to (CiA 301).
const BUSY: u32 = 0;
const SAVES_ON_COMMAND: u32 = 1;

/// Dictionaries that outlast a reset.
#[derive(Debug, Clone)]
pub(super) struct Storage {
    /// The values that a reset restores.
    stored: Objects,
    /// The values of delivery.
    factory: Objects,
    /// How long saving takes, ns.
    save_ns: u64,
    /// When the present saving ends, ns.
    saved_at_ns: Option<u64>,
    /// Whether stored values have changed since somebody asked.
    has_changed: bool,
}

impl Storage {
    /// The values of delivery, and those stored by a drive that was switched off since.
    pub(super) fn new(factory: &Objects, stored: &Objects, save_ns: u64) -> Self {
        let (factory, stored) = (factory.clone(), stored.clone());
        Self { stored, factory, save_ns, saved_at_ns: None, has_changed: false }
    }

    /// The values that a reset restores.
    pub(super) fn stored(&self) -> &Objects {
        &self.stored
    }

    /// The values of delivery.
    pub(super) fn factory(&self) -> &Objects {
        &self.factory
    }

    /// Whether stored values have changed since the last call.
    pub(super) fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.has_changed)
    }

    /// Whether the drive saves now.
    pub(super) fn is_busy(&self) -> bool {
        self.saved_at_ns.is_some()
    }

    /// Stores the values of delivery (1011h).
    pub(super) fn restore_factory(&mut self) {
        self.stored = self.factory.clone();
        self.has_changed = true;
    }

    /// Begins to store all parameters (1010h).
    pub(super) fn save(&mut self, now_ns: u64, objects: &mut Objects) {
        self.saved_at_ns = Some(now_ns + self.save_ns);
        objects.set(names::SAVE_ALL, BUSY);
        self.finish(now_ns, objects);
    }

    /// Ends the saving when it is time.
    pub(super) fn finish(&mut self, now_ns: u64, objects: &mut Objects) {
        if self.saved_at_ns.take_if(|saved_at_ns| now_ns >= *saved_at_ns).is_some() {
            objects.set(names::SAVE_ALL, SAVES_ON_COMMAND);
            self.store(objects);
        }
    }

    /// Gives a saving up: the drive restarts.
    pub(super) fn interrupt(&mut self) {
        self.saved_at_ns = None;
    }

    fn store(&mut self, objects: &Objects) {
        for (place, entry) in ENTRIES.iter().enumerate() {
            if entry.access == Access::ReadWrite && !COMMANDS.contains(&entry.address.index) {
                self.stored.words[place] = objects.words[place];
            }
        }
        self.has_changed = true;
    }
}
