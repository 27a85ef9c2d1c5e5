//! The drive's object dictionary: the values of all entries, one word each, at constant places.
//!
//! The dictionary has type, limits and access of its objects, but not their effects. An [`Overlay`] holds the
//! differences of one drive from the table.

use std::marker::PhantomData;

use masseter_can::canopen::{AbortCode, NodeId, ObjectAddress};
use serde::{Deserialize, Serialize};

use crate::table::{Access, DataType, Entry, Initial, MAPPED_MAX, MappingEntry, OBJECTS};

/// Entries of the table.
pub(crate) const COUNT: usize = {
    let (mut count, mut object) = (0, 0);
    while object < OBJECTS.len() {
        count += OBJECTS[object].entries.len();
        object += 1;
    }
    count
};

/// The table's entries, addresses ascending.
pub(crate) static ENTRIES: [Entry; COUNT] = FLAT;

const FLAT: [Entry; COUNT] = {
    let mut flat = [OBJECTS[0].entries[0]; COUNT];
    let (mut place, mut object) = (0, 0);
    while object < OBJECTS.len() {
        let entries = OBJECTS[object].entries;
        let (_, free) = flat.split_at_mut(place);
        free.split_at_mut(entries.len()).0.copy_from_slice(entries);
        place += entries.len();
        object += 1;
    }
    flat
};

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
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slot<T> {
    /// Its index in [`ENTRIES`].
    pub(crate) place: usize,
    kind: PhantomData<T>,
}

/// The place of an entry of the table. A missing entry does not compile.
pub(crate) const fn slot<T: Number>(index: u16, subindex: u8) -> Slot<T> {
    let mut place = 0;
    while FLAT[place].address.index != index || FLAT[place].address.subindex != subindex {
        place += 1;
    }
    assert!(FLAT[place].kind as u8 == T::KIND as u8, "the entry is of another type");
    Slot { place, kind: PhantomData }
}

/// The place of an entry.
///
/// # Errors
/// [`AbortCode::NO_OBJECT`], [`AbortCode::NO_SUBINDEX`].
pub(crate) fn find(address: ObjectAddress) -> Result<usize, AbortCode> {
    ENTRIES.binary_search_by_key(&address, |entry| entry.address).map_err(|_| {
        let exists = OBJECTS.iter().any(|object| object.index() == address.index);
        if exists { AbortCode::NO_SUBINDEX } else { AbortCode::NO_OBJECT }
    })
}

/// The entry of an object, as a drive without quirks has it; `None` for an object that no drive has.
pub fn entry(address: ObjectAddress) -> Option<&'static Entry> {
    find(address).ok().map(|place| &ENTRIES[place])
}

/// The values of a drive's object dictionary.
///
/// ```
/// use masseter_can::canopen::NodeId;
/// use masseter_drives::DriveSettings;
///
/// let objects = DriveSettings::new(NodeId::new(4)?).objects()?;
/// assert_eq!(objects.at(0x1018, 4), 4, "the serial number is the node id");
/// let names: Vec<_> = objects.mapped(0x1A00).map(|entry| entry.name).collect();
/// assert_eq!(names, ["Statusword", "Position actual value", "Torque actual value"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Objects {
    /// One word for each of [`ENTRIES`], whatever its access.
    #[serde(with = "as_list")]
    pub(crate) words: [u32; COUNT],
}

impl Objects {
    /// The values after power-on; those that the settings decide are still 0.
    pub(crate) fn new(node: NodeId) -> Self {
        let words = ENTRIES.each_ref().map(|entry| match entry.initial {
            Initial::Value(value) => value as u32,
            Initial::OfNode(base) => base + u32::from(node.get()),
            Initial::Configured | Initial::Text(_) | Initial::Empty => 0,
        });
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

    /// The word of an entry that the table is known to have.
    ///
    /// # Panics
    /// Where it has no such entry.
    pub fn at(&self, index: u16, subindex: u8) -> u32 {
        let address = ObjectAddress::new(index, subindex);
        self.words[find(address).unwrap_or_else(|_| panic!("the table has no entry {address}"))]
    }

    /// Sets the word of an entry that the table is known to have, whatever its access.
    ///
    /// # Panics
    /// Where it has no such entry.
    pub(crate) fn set_at(&mut self, index: u16, subindex: u8, word: u32) {
        let address = ObjectAddress::new(index, subindex);
        self.words[find(address).unwrap_or_else(|_| panic!("the table has no entry {address}"))] = word;
    }

    /// Writes a mapping parameter.
    pub(crate) fn set_mapping(&mut self, index: u16, entries: &[u32]) {
        for place in 1..=MAPPED_MAX {
            let entry = entries.get(place - 1).copied().unwrap_or(0);
            self.set_at(index, place as u8, entry);
        }
        self.set_at(index, 0, entries.len() as u32);
    }

    /// The first `count` entries of a mapping parameter.
    pub(crate) fn mapping(&self, index: u16, count: u32) -> impl Iterator<Item = MappingEntry> {
        (1..=count as u8).map(move |subindex| MappingEntry(self.at(index, subindex)))
    }

    /// The entries that a mapping parameter (1600h, 1A00h and following) maps, in their order.
    ///
    /// # Panics
    /// Where there is no such parameter.
    pub fn mapped(&self, index: u16) -> impl Iterator<Item = &'static Entry> {
        self.mapped_places(index).map(|place| &ENTRIES[place])
    }

    /// The places of the entries that a mapping parameter maps.
    pub(crate) fn mapped_places(&self, index: u16) -> impl Iterator<Item = usize> {
        let entries = self.mapping(index, self.at(index, 0));
        entries.map(|entry| find(entry.object()).expect("only what exists can be mapped"))
    }

    /// Takes all values in that range of indices from another dictionary.
    pub(crate) fn copy_range(&mut self, from: &Self, indices: std::ops::RangeInclusive<u16>) {
        for (place, entry) in ENTRIES.iter().enumerate() {
            if indices.contains(&entry.address.index) {
                self.words[place] = from.words[place];
            }
        }
    }
}

/// A difference of an entry from the table's.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
enum Change {
    /// The drive lacks the entry.
    Hidden,
    /// The entry takes these values alone.
    Limited(i64, i64),
    /// Clients cannot write the entry.
    Locked,
}

/// The differences of one drive; none for a drive that has the whole table.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Overlay {
    /// Changes, each with its place in the table.
    changes: Vec<(usize, Change)>,
    /// Places whose entries show a value that no write changes.
    shown: Vec<(usize, u32)>,
}

impl Overlay {
    /// The drive lacks an entry.
    pub(crate) fn hide(&mut self, place: usize) {
        self.changes.push((place, Change::Hidden));
    }

    /// Sets the constant value of an entry, which no write changes.
    pub(crate) fn show(&mut self, place: usize, word: u32) {
        self.shown.push((place, word));
    }

    /// The constant value of an entry, if any.
    pub(crate) fn shown(&self, place: usize) -> Option<u32> {
        self.shown.iter().find(|(at, _)| *at == place).map(|(_, word)| *word)
    }

    /// An entry takes these values alone.
    pub(crate) fn limit(&mut self, place: usize, lowest: i64, highest: i64) {
        self.changes.push((place, Change::Limited(lowest, highest)));
    }

    /// Clients cannot write an entry.
    pub(crate) fn lock(&mut self, place: usize) {
        self.changes.push((place, Change::Locked));
    }

    /// The entry at a place of the table; `None` if the drive lacks it.
    pub(crate) fn entry(&self, place: usize) -> Option<Entry> {
        let mut changes = self.changes.iter().filter(|(at, _)| *at == place);
        changes.try_fold(ENTRIES[place], |entry, (_, change)| match *change {
            Change::Hidden => None,
            Change::Limited(lowest, highest) => Some(entry.within(lowest, highest)),
            Change::Locked => Some(Entry { access: Access::ReadOnly, ..entry }),
        })
    }

    /// The place of an entry in the table, and the entry as this drive has it.
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`], [`AbortCode::NO_SUBINDEX`].
    pub(crate) fn find(&self, address: ObjectAddress) -> Result<(usize, Entry), AbortCode> {
        let place = find(address)?;
        if let Some(entry) = self.entry(place) {
            return Ok((place, entry));
        }
        let mut of_object = (0..ENTRIES.len()).filter(|&at| ENTRIES[at].address.index == address.index);
        let is_there = of_object.any(|at| self.entry(at).is_some());
        Err(if is_there { AbortCode::NO_SUBINDEX } else { AbortCode::NO_OBJECT })
    }
}

/// An array of more elements than serde takes, as a list.
mod as_list {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub(super) fn serialize<T: Serialize, S: Serializer>(array: &[T], to: S) -> Result<S::Ok, S::Error> {
        array.serialize(to)
    }

    pub(super) fn deserialize<'de, T, D, const N: usize>(from: D) -> Result<[T; N], D::Error>
    where
        T: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        let list = Vec::deserialize(from)?;
        list.try_into().map_err(|list: Vec<T>| D::Error::invalid_length(list.len(), &"another length"))
    }
}

#[cfg(test)]
mod objects_tests {
    use super::*;
    use crate::table::Access;

    #[test]
    fn every_entry_is_found_at_its_address() {
        for (place, entry) in ENTRIES.iter().enumerate() {
            assert_eq!(find(entry.address), Ok(place));
            assert!(place == 0 || ENTRIES[place - 1].address < entry.address, "addresses must ascend");
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
            let last = object.entries[object.entries.len() - 1].address.subindex;
            let first = object.entries[0];
            if first.access == Access::Constant {
                assert_eq!(first.initial, Initial::Value(i64::from(last)), "{}", object.name);
            }
        }
    }

    #[test]
    fn initial_values_keep_to_their_limits() {
        let objects = Objects::new(NodeId::new(5).unwrap());
        for (entry, word) in ENTRIES.iter().zip(objects.words) {
            if entry.initial != Initial::Configured {
                assert_eq!(entry.check_limits(word), Ok(()), "{}", entry.address);
            }
        }
    }
}

#[cfg(test)]
mod overlay_tests {
    use super::*;
    use crate::names;

    #[test]
    fn a_drive_has_the_table_but_for_its_differences() {
        let mut overlay = Overlay::default();
        overlay.hide(names::HOME_OFFSET.place);
        overlay.limit(names::PERIOD_VALUE.place, 1, 100);
        overlay.lock(names::PERIOD_VALUE.place);
        assert_eq!(overlay.find(ObjectAddress::new(0x607C, 0)).unwrap_err(), AbortCode::NO_OBJECT);
        assert_eq!(overlay.find(ObjectAddress::new(0x60C2, 9)).unwrap_err(), AbortCode::NO_SUBINDEX);
        let (place, entry) = overlay.find(ObjectAddress::new(0x60C2, 1)).unwrap();
        assert_eq!((place, entry.limits), (names::PERIOD_VALUE.place, Some((1, 100))));
        assert_eq!(entry.check_access(), Err(AbortCode::READ_ONLY));
        assert!(overlay.entry(names::MODE.place).unwrap().check_access().is_ok());
    }
}
