//! A PDO's mapping, compiled into copies of bytes.

use masseter_can::Frame;
use masseter_can::canopen::ObjectAddress;

use crate::drive::dictionary::{ENTRIES, MAPPED_MAX, MappingEntry, Objects, find, within_limits};

/// The lowest transmission type that SYNC does not trigger.
pub(super) const EVENT_DRIVEN: u8 = 254;
/// Bytes that a PDO of the drive carries at most, whatever the format of its frames.
pub(super) const MAX_BYTES: usize = Frame::MAX_DATA;

/// A mapped object: place of its word, and number of its bytes.
#[derive(Debug, Clone, Copy, Default)]
struct Part {
    place: u16,
    bytes: u8,
}

impl Part {
    fn address(self) -> ObjectAddress {
        ENTRIES[usize::from(self.place)].address
    }

    fn bits(self) -> u32 {
        8 * u32::from(self.bytes)
    }

    /// The bits of a word that are mapped.
    fn mask(self) -> u32 {
        u32::MAX >> (u32::BITS - self.bits())
    }
}

/// A compiled mapping.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Mapped {
    parts: [Part; MAPPED_MAX],
    count: usize,
    pub(super) length: usize,
}

impl Mapped {
    /// Compiles the mapping parameter of that index.
    pub(super) fn compile(objects: &Objects, index: u16) -> Self {
        let mut mapped = Self { count: objects.at(index, 0) as usize, ..Self::default() };
        for place in 0..mapped.count {
            let entry = MappingEntry(objects.at(index, place as u8 + 1));
            let object = find(entry.object()).expect("only what exists can be mapped");
            let bytes = ENTRIES[object].entry.kind.bytes();
            mapped.parts[place] = Part { place: object as u16, bytes: bytes as u8 };
            mapped.length += bytes;
        }
        mapped
    }

    /// The mapping of those objects that fulfil a condition.
    pub(super) fn only(&self, holds: impl Fn(ObjectAddress) -> bool) -> Self {
        let mut only = Self::default();
        for part in self.parts().iter().filter(|part| holds(part.address())) {
            only.parts[only.count] = *part;
            only.count += 1;
            only.length += usize::from(part.bytes);
        }
        only
    }

    fn parts(&self) -> &[Part] {
        &self.parts[..self.count]
    }

    /// Whether an object is mapped.
    pub(super) fn holds(&self, object: ObjectAddress) -> bool {
        self.parts().iter().any(|part| part.address() == object)
    }

    /// The data of the objects, followed by zeros.
    pub(super) fn pack(&self, objects: &Objects) -> [u8; MAX_BYTES] {
        let (mut data, mut at) = (0, 0);
        for part in self.parts() {
            let word = objects.word(usize::from(part.place)) & part.mask();
            data |= u64::from(word) << at;
            at += part.bits();
        }
        data.to_le_bytes()
    }

    /// Writes the data into the objects; a value beyond its limits leaves its object as it is.
    pub(super) fn unpack(&self, data: [u8; MAX_BYTES], objects: &mut Objects) {
        let mut data = u64::from_le_bytes(data);
        for part in self.parts() {
            let (place, word) = (usize::from(part.place), data as u32 & part.mask());
            if within_limits(place, word).is_ok() {
                objects.set_word(place, word);
            }
            data >>= part.bits();
        }
    }
}
