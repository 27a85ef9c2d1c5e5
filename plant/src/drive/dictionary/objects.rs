//! The values of all entries: one word each, at places that are constants.

use std::marker::PhantomData;

use masseter_can::canopen::{AbortCode, CobId, NodeId, ObjectAddress};

use super::entry::{Access, Addressed, DataType, Initial};
use super::table::OBJECTS;

/// Entries of the table.
pub(crate) const COUNT: usize = {
    let (mut count, mut object) = (0, 0);
    while object < OBJECTS.len() {
        count += OBJECTS[object].entries.len();
        object += 1;
    }
    count
};

/// The table's entries with their addresses, ascending.
pub(crate) static ENTRIES: [Addressed; COUNT] = FLAT;

const FLAT: [Addressed; COUNT] = {
    let first = Addressed { address: ObjectAddress::new(OBJECTS[0].index, 0), entry: OBJECTS[0].entries[0] };
    let mut flat = [first; COUNT];
    let (mut place, mut object) = (0, 0);
    while object < OBJECTS.len() {
        let mut entry = 0;
        while entry < OBJECTS[object].entries.len() {
            let address = ObjectAddress::new(OBJECTS[object].index, OBJECTS[object].entries[entry].subindex);
            flat[place] = Addressed { address, entry: OBJECTS[object].entries[entry] };
            assert!(place == 0 || precedes(flat[place - 1].address, address), "addresses must ascend");
            place += 1;
            entry += 1;
        }
        object += 1;
    }
    flat
};

const fn precedes(a: ObjectAddress, b: ObjectAddress) -> bool {
    a.index < b.index || a.index == b.index && a.subindex < b.subindex
}

/// A type that an entry can have.
pub(crate) trait Number: Copy {
    /// The entry's data type.
    const KIND: DataType;
    /// The value in a memory word.
    fn from_word(word: u32) -> Self;
    /// The memory word of a value.
    fn word(self) -> u32;
}

macro_rules! numbers {
    ($($type:ident is $kind:ident),*) => {$(
        impl Number for $type {
            const KIND: DataType = DataType::$kind;
            fn from_word(word: u32) -> Self {
                word as Self
            }
            fn word(self) -> u32 {
                self as u32
            }
        }
    )*};
}

numbers!(i8 is I8, i16 is I16, i32 is I32, u8 is U8, u16 is U16, u32 is U32);

/// Place of an entry of that type.
#[derive(Debug)]
pub(crate) struct Slot<T> {
    place: usize,
    kind: PhantomData<T>,
}

impl<T> Clone for Slot<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Slot<T> {}

impl<T> Slot<T> {
    /// Where it is among [`ENTRIES`].
    pub(crate) const fn place(self) -> usize {
        self.place
    }
}

/// The place of an entry of the table; an entry that does not exist does not compile.
pub(crate) const fn slot<T: Number>(index: u16, subindex: u8) -> Slot<T> {
    let mut place = 0;
    while FLAT[place].address.index != index || FLAT[place].address.subindex != subindex {
        place += 1;
    }
    assert!(FLAT[place].entry.kind as u8 == T::KIND as u8, "the entry is of another type");
    Slot { place, kind: PhantomData }
}

/// The place of an entry.
///
/// # Errors
/// [`AbortCode::NO_OBJECT`], [`AbortCode::NO_SUBINDEX`].
pub(crate) fn find(address: ObjectAddress) -> Result<usize, AbortCode> {
    ENTRIES.binary_search_by_key(&address, |entry| entry.address).map_err(|near| {
        let is_neighbour =
            |place: usize| ENTRIES.get(place).is_some_and(|entry| entry.address.index == address.index);
        let exists = is_neighbour(near) || is_neighbour(near.wrapping_sub(1));
        if exists { AbortCode::NO_SUBINDEX } else { AbortCode::NO_OBJECT }
    })
}

/// The values of a drive's object dictionary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Objects {
    words: [u32; COUNT],
}

impl Objects {
    /// The values after power-on; those that the scenario configures are still 0.
    pub(crate) fn new(node: NodeId) -> Self {
        let mut words = [0; COUNT];
        for (word, addressed) in words.iter_mut().zip(&ENTRIES) {
            *word = match addressed.entry.initial {
                Initial::Value(value) => value as u32,
                Initial::OfNode(base) => base + u32::from(node.get()),
                Initial::Configured | Initial::Text(_) => 0,
            };
        }
        Self { words }
    }

    /// A value.
    pub(crate) fn get<T: Number>(&self, slot: Slot<T>) -> T {
        T::from_word(self.words[slot.place])
    }

    /// Sets a value, whatever its access.
    pub(crate) fn set<T: Number>(&mut self, slot: Slot<T>, value: T) {
        self.words[slot.place] = value.word();
    }

    /// The word at a place of [`ENTRIES`].
    pub(crate) fn word(&self, place: usize) -> u32 {
        self.words[place]
    }

    /// Changes the word at a place of [`ENTRIES`].
    pub(crate) fn set_word(&mut self, place: usize, word: u32) {
        self.words[place] = word;
    }

    /// The word of an entry that the table is known to have.
    ///
    /// # Panics
    /// Where it has no such entry.
    pub(crate) fn at(&self, index: u16, subindex: u8) -> u32 {
        let address = ObjectAddress::new(index, subindex);
        self.word(find(address).unwrap_or_else(|_| panic!("the table has no entry {address}")))
    }

    /// The COB-ID of such an entry.
    pub(crate) fn cob_id(&self, index: u16, subindex: u8) -> CobId {
        CobId(self.at(index, subindex))
    }

    /// Takes all values in that range of indices from another dictionary.
    pub(crate) fn copy_range(&mut self, from: &Self, indices: std::ops::RangeInclusive<u16>) {
        for (place, addressed) in ENTRIES.iter().enumerate() {
            if indices.contains(&addressed.address.index) {
                self.words[place] = from.words[place];
            }
        }
    }
}

/// The memory word that a client may write to an entry.
///
/// # Errors
/// The abort code for a wrong length, a value out of range, or an entry that clients may not write.
pub(crate) fn writable(place: usize, data: &[u8], is_sized: bool) -> Result<u32, AbortCode> {
    let entry = &ENTRIES[place].entry;
    if entry.access != Access::ReadWrite {
        return Err(AbortCode::READ_ONLY);
    }
    let bytes = entry.kind.bytes();
    if is_sized && data.len() > bytes {
        return Err(AbortCode::TOO_LONG);
    }
    let data = data.get(..bytes).ok_or(AbortCode::TOO_SHORT)?;
    let mut word = [0; 4];
    word[..bytes].copy_from_slice(data);
    let word = u32::from_le_bytes(word);
    within_limits(place, word)?;
    Ok(word)
}

/// Whether a value keeps to the entry's limits.
///
/// # Errors
/// [`AbortCode::TOO_HIGH`], [`AbortCode::TOO_LOW`].
pub(crate) fn within_limits(place: usize, word: u32) -> Result<(), AbortCode> {
    let entry = &ENTRIES[place].entry;
    let Some((lowest, highest)) = entry.limits else { return Ok(()) };
    let value = entry.kind.number(word);
    if value > highest {
        return Err(AbortCode::TOO_HIGH);
    }
    if value < lowest {
        return Err(AbortCode::TOO_LOW);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_entry_is_found_at_its_address() {
        for (place, addressed) in ENTRIES.iter().enumerate() {
            assert_eq!(find(addressed.address), Ok(place));
        }
        assert_eq!(find(ObjectAddress::new(0x1018, 5)), Err(AbortCode::NO_SUBINDEX));
        assert_eq!(find(ObjectAddress::new(0x1800, 4)), Err(AbortCode::NO_SUBINDEX));
        assert_eq!(find(ObjectAddress::new(0x0FFF, 0)), Err(AbortCode::NO_OBJECT));
        assert_eq!(find(ObjectAddress::new(0x2000, 0)), Err(AbortCode::NO_OBJECT));
        assert_eq!(find(ObjectAddress::new(0xFFFF, 0)), Err(AbortCode::NO_OBJECT));
    }

    #[test]
    fn sub_index_0_is_the_highest_of_its_object() {
        for object in OBJECTS.iter().filter(|object| object.entries.len() > 1) {
            let last = object.entries[object.entries.len() - 1].subindex;
            let first = object.entries[0];
            if first.access == Access::Constant {
                assert_eq!(first.initial, Initial::Value(i64::from(last)), "{:04X}h", object.index);
            }
        }
    }

    #[test]
    fn initial_values_keep_to_their_limits() {
        let objects = Objects::new(NodeId::new(5).unwrap());
        for (place, addressed) in ENTRIES.iter().enumerate() {
            if addressed.entry.initial != Initial::Configured {
                assert_eq!(within_limits(place, objects.word(place)), Ok(()), "{}", addressed.address);
            }
        }
    }
}
