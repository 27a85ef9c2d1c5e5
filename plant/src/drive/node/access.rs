//! SDO access to the object dictionary: reading, writing, and the checks of both.
//!
//! A write only changes the dictionary. The node applies its effect on the drive, from [`DictionaryAccess::written`].

use masseter_can::canopen::{AbortCode, Expedited, ObjectAddress};

use super::rules::check;
use super::storage::Storage;
use crate::drive::axis::Axis;
use crate::drive::dictionary::{Initial, Objects, Overlay, names};

/// A value that was read.
pub(super) enum Value {
    Number(Expedited),
    Text(&'static str),
}

/// A client's access at an instant.
pub(super) struct DictionaryAccess<'a> {
    pub(super) now_ns: u64,
    pub(super) objects: &'a mut Objects,
    pub(super) storage: &'a mut Storage,
    pub(super) axis: &'a Axis,
    pub(super) overlay: &'a Overlay,
    pub(super) is_operational: bool,
    /// Whether PDO parameters cannot be written now.
    pub(super) locks_pdos: bool,
    /// The object written, whose effect is due.
    pub(super) written: Option<ObjectAddress>,
}

impl DictionaryAccess<'_> {
    /// The value of an entry.
    pub(super) fn read(&mut self, object: ObjectAddress) -> Result<Value, AbortCode> {
        let (place, entry) = self.overlay.find(object)?;
        if let Initial::Text(text) = entry.initial {
            return Ok(Value::Text(text));
        }
        if object.index == 0x1003 && object.subindex > self.objects.get(names::ERROR_COUNT) {
            return Err(AbortCode::NO_DATA);
        }
        self.axis.show(self.now_ns, self.objects);
        let word = self.overlay.shown(place).unwrap_or(self.objects.words[place]).to_le_bytes();
        let data = Expedited::new(&word[..entry.kind.bytes()]).ok_or(AbortCode::GENERAL)?;
        Ok(Value::Number(data))
    }

    /// Writes an entry; where `is_sized` is false, `data` may be longer than the value.
    pub(super) fn write(
        &mut self,
        object: ObjectAddress,
        data: &[u8],
        is_sized: bool,
    ) -> Result<(), AbortCode> {
        let (place, entry) = self.overlay.find(object)?;
        if self.overlay.shown(place).is_some() {
            return entry.check_access();
        }
        let word = entry.writable(data, is_sized)?;
        let is_closed = match object.index {
            0x1400..0x1C00 => self.locks_pdos,
            0x1010 | 0x1011 => self.storage.is_busy(),
            _ => false,
        };
        if is_closed {
            return Err(AbortCode::DEVICE_STATE);
        }
        check(object, word, self.objects, self.axis, self.overlay, self.is_operational)?;
        match object.index {
            0x1010 => self.storage.save(self.now_ns, self.objects),
            0x1011 => self.storage.restore_factory(),
            _ => {
                self.objects.words[place] = word;
                self.written = Some(object);
            }
        }
        Ok(())
    }
}
