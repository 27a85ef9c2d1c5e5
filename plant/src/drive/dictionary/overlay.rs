//! Where a drive's dictionary differs from the table: objects that it lacks, entries with other limits or another access.

use masseter_can::canopen::{AbortCode, ObjectAddress};

use super::entry::{Access, Entry};
use super::objects::{ENTRIES, find};

/// The differences of one drive; none for a drive that has the whole table.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overlay {
    /// Places in the table with their entries in this drive; none where the drive lacks it.
    changed: Vec<(usize, Option<Entry>)>,
    /// Places whose entries show a value that no write changes.
    shown: Vec<(usize, u32)>,
}

impl Overlay {
    /// The drive lacks an object.
    pub(crate) fn hide(&mut self, index: u16) {
        let places = (0..ENTRIES.len()).filter(|place| ENTRIES[*place].address.index == index);
        self.changed.extend(places.map(|place| (place, None)));
    }

    /// The drive lacks an entry.
    pub(crate) fn hide_entry(&mut self, place: usize) {
        self.changed.push((place, None));
    }

    /// An entry shows this value, whatever is written.
    pub(crate) fn show(&mut self, place: usize, word: u32) {
        self.shown.push((place, word));
    }

    /// The value that an entry shows whatever is written, if it has one.
    pub(crate) fn shown(&self, place: usize) -> Option<u32> {
        self.shown.iter().find(|(at, _)| *at == place).map(|(_, word)| *word)
    }

    /// An entry takes these values alone.
    pub(crate) fn limit(&mut self, place: usize, lowest: i64, highest: i64) {
        self.change(place, |entry| entry.within(lowest, highest));
    }

    /// Clients cannot write an entry.
    pub(crate) fn lock(&mut self, place: usize) {
        self.change(place, |entry| Entry { access: Access::ReadOnly, ..entry });
    }

    fn change(&mut self, place: usize, change: impl FnOnce(Entry) -> Entry) {
        if let Some(entry) = self.entry(place).copied() {
            self.changed.retain(|(at, _)| *at != place);
            self.changed.push((place, Some(change(entry))));
        }
    }

    /// The entry at a place of the table; none where the drive lacks it.
    pub(crate) fn entry(&self, place: usize) -> Option<&Entry> {
        let changed = self.changed.iter().find(|(at, _)| *at == place);
        changed.map_or(Some(&ENTRIES[place]), |(_, entry)| entry.as_ref())
    }

    /// The place of an entry in the table, and the entry as this drive has it.
    ///
    /// # Errors
    /// [`AbortCode::NO_OBJECT`], [`AbortCode::NO_SUBINDEX`].
    pub(crate) fn find(&self, address: ObjectAddress) -> Result<(usize, &Entry), AbortCode> {
        let place = find(address)?;
        if let Some(entry) = self.entry(place) {
            return Ok((place, entry));
        }
        let mut of_object = (0..ENTRIES.len()).filter(|&at| ENTRIES[at].address.index == address.index);
        let is_there = of_object.any(|at| self.entry(at).is_some());
        Err(if is_there { AbortCode::NO_SUBINDEX } else { AbortCode::NO_OBJECT })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::dictionary::names;

    #[test]
    fn a_drive_has_the_table_but_for_its_differences() {
        let mut overlay = Overlay::default();
        overlay.hide(0x607D);
        overlay.limit(names::PERIOD_VALUE.place, 1, 100);
        overlay.lock(names::PERIOD_VALUE.place);
        assert_eq!(overlay.find(ObjectAddress::new(0x607D, 1)).unwrap_err(), AbortCode::NO_OBJECT);
        assert_eq!(overlay.find(ObjectAddress::new(0x60C2, 9)).unwrap_err(), AbortCode::NO_SUBINDEX);
        let (place, entry) = overlay.find(ObjectAddress::new(0x60C2, 1)).unwrap();
        assert_eq!((place, entry.limits), (names::PERIOD_VALUE.place, Some((1, 100))));
        assert_eq!(entry.check_access(), Err(AbortCode::READ_ONLY));
        assert!(overlay.entry(names::MODE.place).unwrap().check_access().is_ok());
    }
}
