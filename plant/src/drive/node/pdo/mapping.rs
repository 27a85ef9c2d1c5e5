//! A PDO's mapping, compiled into copies of bytes.

use arrayvec::ArrayVec;
use masseter_can::Frame;

use crate::drive::dictionary::{ENTRIES, MAPPED_MAX, Objects};

/// The lowest transmission type that SYNC does not trigger.
pub(super) const EVENT_DRIVEN: u8 = 254;
/// Bytes that a PDO of the drive carries at most, whatever the format of its frames.
pub(super) const MAX_BYTES: usize = Frame::MAX_DATA;

/// A mapped object: its place in the dictionary and its length.
#[derive(Debug, Clone, Copy)]
struct Part {
    place: usize,
    bits: u32,
}

impl Part {
    fn index(self) -> u16 {
        ENTRIES[self.place].address.index
    }

    /// The bits of a word that are mapped.
    fn mask(self) -> u32 {
        u32::MAX >> (u32::BITS - self.bits)
    }
}

/// A compiled mapping.
#[derive(Debug, Clone)]
pub(super) struct Mapped(ArrayVec<Part, MAPPED_MAX>);

impl Mapped {
    /// Compiles the mapping parameter of that index.
    pub(super) fn compile(objects: &Objects, index: u16) -> Self {
        let part = |place: usize| Part { place, bits: 8 * ENTRIES[place].kind.bytes() as u32 };
        Self(objects.mapped(index).map(part).collect())
    }

    /// Keeps the objects of those indices only.
    pub(super) fn retain(&mut self, keeps: impl Fn(u16) -> bool) {
        self.0.retain(|part| keeps(part.index()));
    }

    /// Bytes of the data.
    pub(super) fn length(&self) -> usize {
        self.0.iter().map(|part| part.bits as usize / 8).sum()
    }

    /// The indices of the mapped objects.
    pub(super) fn indices(&self) -> impl Iterator<Item = u16> {
        self.0.iter().map(|part| part.index())
    }

    /// The data of the objects, followed by zeros.
    pub(super) fn pack(&self, objects: &Objects) -> [u8; MAX_BYTES] {
        let (mut data, mut at) = (0, 0);
        for part in &self.0 {
            data |= u64::from(objects.words[part.place] & part.mask()) << at;
            at += part.bits;
        }
        data.to_le_bytes()
    }

    /// Writes the data into the objects; a value beyond its limits leaves its object as it is.
    pub(super) fn unpack(&self, data: [u8; MAX_BYTES], objects: &mut Objects) {
        let mut data = u64::from_le_bytes(data);
        for part in &self.0 {
            let word = data as u32 & part.mask();
            if ENTRIES[part.place].check_limits(word).is_ok() {
                objects.words[part.place] = word;
            }
            data >>= part.bits;
        }
    }
}
