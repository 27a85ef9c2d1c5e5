//! A client's access to the object dictionary, and what the drive keeps beside it.
//!
//! [`DictionaryAccess`] reads and writes entries by the rules of the standard. They cover values without a range,
//! parameters in use, and the procedure of CiA 301 for a change of a PDO. A write only changes the dictionary. The node
//! applies the effect on the drive, from [`DictionaryAccess::written`].

use masseter_can::canopen::{AbortCode, CobId, Expedited, ObjectAddress};

use super::state::consumed_node;
use crate::axis::Axis;
use crate::axis::modes::Homing;
use crate::axis::motion::Mode;
use crate::dictionary::{ENTRIES, Objects, Overlay};
use crate::names;
use crate::table::{Access, CONSUMED, DataType, Initial, MAPPED_MAX, Mapping, MappingEntry, USER_DATA_MAX};

/// A value that was read.
pub(super) enum Value {
    Number(Expedited),
    /// A text or a domain.
    Bytes(Vec<u8>),
}

/// A client's access at an instant.
pub(super) struct DictionaryAccess<'a> {
    pub(super) now_ns: u64,
    pub(super) objects: &'a mut Objects,
    pub(super) storage: &'a mut Storage,
    /// The content of 2010h.
    pub(super) user_data: &'a mut Vec<u8>,
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
        match entry.initial {
            Initial::Text(text) => return Ok(Value::Bytes(text.into())),
            Initial::Empty => return Ok(Value::Bytes(self.user_data.clone())),
            _ => {}
        }
        if object.index == 0x1003 && object.subindex > self.objects.get(names::ERROR_COUNT) {
            return Err(AbortCode::NO_DATA);
        }
        self.axis.show(self.now_ns, self.objects);
        let word = self.overlay.shown(place).unwrap_or(self.objects.words[place]).to_le_bytes();
        let data = Expedited::new(&word[..entry.kind.bytes()]).ok_or(AbortCode::GENERAL)?;
        Ok(Value::Number(data))
    }

    /// The bytes that a client may write to an entry, of which it has announced so many.
    pub(super) fn room(&self, object: ObjectAddress, size: Option<u32>) -> Result<usize, AbortCode> {
        let (_, entry) = self.overlay.find(object)?;
        entry.check_access()?;
        let room = if entry.kind == DataType::Domain { USER_DATA_MAX } else { Expedited::MAX };
        allow(size.is_none_or(|size| size as usize <= room), AbortCode::TOO_LONG)?;
        Ok(room)
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
        if entry.kind == DataType::Domain {
            entry.check_access()?;
            allow(data.len() <= USER_DATA_MAX, AbortCode::TOO_LONG)?;
            *self.user_data = data.to_vec();
            return Ok(());
        }
        let word = entry.writable(data, is_sized)?;
        let is_closed = match object.index {
            0x1400..0x1C00 => self.locks_pdos,
            0x1010 | 0x1011 => self.storage.saved_at_ns.is_some(),
            _ => false,
        };
        if is_closed {
            return Err(AbortCode::DEVICE_STATE);
        }
        self.check_value(object, word)?;
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

    /// Whether that word may be written to an entry now.
    ///
    /// # Errors
    /// The abort code with the reason.
    fn check_value(&self, object: ObjectAddress, word: u32) -> Result<(), AbortCode> {
        let (ObjectAddress { index, subindex }, objects, axis) = (object, &*self.objects, self.axis);
        match index {
            0x1003 => allow(word == 0, AbortCode::INVALID_VALUE),
            0x1010 => {
                allow(word == SAVE, AbortCode::NOT_STORED)?;
                allow(!axis.power.is_enabled(), AbortCode::DEVICE_STATE)
            }
            0x1011 => allow(word == LOAD, AbortCode::NOT_STORED),
            0x1014 => cob_id(CobId(objects.get(names::EMERGENCY_COB_ID)), CobId(word)),
            0x1016 => {
                allow(!is_consumed_elsewhere(subindex, word, objects), AbortCode::PARAMETER_INCOMPATIBLE)
            }
            0x1019 => {
                allow(word != 1, AbortCode::INVALID_VALUE)?;
                allow(!self.is_operational, AbortCode::DEVICE_STATE)
            }
            0x1400..0x1600 | 0x1800..0x1A00 => communication(object, word, objects),
            0x1600..0x1800 | 0x1A00..0x1C00 => mapping(object, word, objects, self.overlay),
            0x605A => allow(!matches!(word, 3 | 4), AbortCode::INVALID_VALUE),
            // 0 leaves the mode as it is.
            0x6060 => allow(
                word as i8 == 0 || Mode::supported(word as i8, objects).is_some(),
                AbortCode::INVALID_VALUE,
            ),
            0x607D => {
                let (lowest, highest) = match subindex {
                    1 => (word as i32, objects.get(names::MAX_POSITION_LIMIT)),
                    _ => (objects.get(names::MIN_POSITION_LIMIT), word as i32),
                };
                allow(lowest <= highest, AbortCode::MAXIMUM_BELOW_MINIMUM)
            }
            0x6098 => {
                allow(Homing::is_method(word as i8), AbortCode::INVALID_VALUE)?;
                allow(!axis.homing.is_running(), AbortCode::DEVICE_STATE)
            }
            0x60C2 => allow(!axis.power.is_enabled(), AbortCode::DEVICE_STATE),
            _ => Ok(()),
        }
    }
}

/// Signature of 1010h, "save".
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Signature of 1011h, "load".
const LOAD: u32 = u32::from_le_bytes(*b"load");
/// Bits that a PDO carries at most.
const PDO_BITS: usize = 64;

/// An error unless the condition holds.
fn allow(is_allowed: bool, code: AbortCode) -> Result<(), AbortCode> {
    if is_allowed { Ok(()) } else { Err(code) }
}

/// Whether another entry of 1016h consumes the same node's heartbeat.
fn is_consumed_elsewhere(subindex: u8, word: u32, objects: &Objects) -> bool {
    let Some(node) = consumed_node(word) else { return false };
    let mut others = (1..=CONSUMED as u8).filter(|&other| other != subindex);
    others.any(|other| consumed_node(objects.at(0x1016, other)) == Some(node))
}

/// A new COB-ID in place of an old one: an identifier may change only while its object does not exist.
fn cob_id(before: CobId, after: CobId) -> Result<(), AbortCode> {
    let takes_restricted = after.is_valid() && is_restricted(after.number());
    let is_changed = before.is_valid() && after.is_valid() && after.number() != before.number();
    allow(after.is_standard() && !takes_restricted && !is_changed, AbortCode::INVALID_VALUE)
}

/// Identifiers that no configurable object may use (CiA 301, table 40).
const fn is_restricted(identifier: u32) -> bool {
    matches!(
        identifier,
        0x000..=0x080 | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..
    )
}

/// The COB-ID of the PDO that a communication or mapping parameter belongs to.
fn pdo_cob_id(index: u16, objects: &Objects) -> CobId {
    // 1600h + n belongs to 1400h + n, 1A00h + n to 1800h + n.
    let communication = index & !0x0200 & 0xFC00 | index & 0x00FF;
    CobId(objects.at(communication, 1))
}

fn communication(object: ObjectAddress, word: u32, objects: &Objects) -> Result<(), AbortCode> {
    let before = pdo_cob_id(object.index, objects);
    let is_allowed = match object.subindex {
        1 => {
            cob_id(before, CobId(word))?;
            let carries_nothing = objects.at(object.index + 0x0200, 0) == 0;
            !(CobId(word).is_valid() && carries_nothing)
        }
        // 241 to 251 are reserved, 252 and 253 answer remote requests.
        2 => !matches!(word, 241..=253),
        3 | 6 => !before.is_valid(),
        _ => true,
    };
    allow(is_allowed, AbortCode::INVALID_VALUE)
}

/// The mapping changes only while the PDO does not exist, its entries only while it holds none.
fn mapping(object: ObjectAddress, word: u32, objects: &Objects, overlay: &Overlay) -> Result<(), AbortCode> {
    let ObjectAddress { index, subindex } = object;
    let exists = pdo_cob_id(index, objects).is_valid();
    let is_open = !exists && (subindex == 0 || objects.at(index, 0) == 0);
    allow(is_open, AbortCode::PARAMETER_INCOMPATIBLE)?;
    if subindex > 0 {
        let is_transmitted = index >= 0x1A00;
        return if word == 0 { Ok(()) } else { mappable(MappingEntry(word), is_transmitted, overlay) };
    }
    let has_gap = objects.mapping(index, word).any(|entry| entry.0 == 0);
    allow(!has_gap, AbortCode::PARAMETER_INCOMPATIBLE)?;
    let bits: usize = objects.mapping(index, word).map(MappingEntry::bits).sum();
    allow(bits <= PDO_BITS, AbortCode::PDO_LENGTH)
}

/// Whether an object may be mapped with that length.
fn mappable(entry: MappingEntry, is_transmitted: bool, overlay: &Overlay) -> Result<(), AbortCode> {
    let (_, object) = overlay.find(entry.object())?;
    let is_allowed = match object.mapping {
        Mapping::Never => false,
        Mapping::Tpdo => is_transmitted,
        Mapping::Any => true,
    };
    let has_length = object.kind.bytes() > 0 && object.kind.bytes() * 8 == entry.bits();
    allow(is_allowed && has_length, AbortCode::NOT_MAPPABLE)
}

const _: () = assert!(MAPPED_MAX * 8 == PDO_BITS, "eight bytes hold eight objects at most");

/// Objects that command something at once; they are no parameters.
const COMMANDS: [u16; 10] = [0x1003, 0x1010, 0x1011, 0x6040, 0x6071, 0x607A, 0x60B0, 0x60B1, 0x60B2, 0x60FF];
/// 1010h:01 while the drive saves, and when it can be asked to (CiA 301).
const BUSY: u32 = 0;
const SAVES_ON_COMMAND: u32 = 1;

/// Dictionaries that survive a reset.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub(super) struct Storage {
    /// The values that a reset restores.
    pub(super) stored: Objects,
    /// The values of delivery.
    pub(super) factory: Objects,
    /// How long saving takes, ns.
    save_ns: u64,
    /// When the present saving ends, ns.
    pub(super) saved_at_ns: Option<u64>,
    /// Whether stored values have changed since somebody asked.
    pub(super) has_changed: bool,
}

impl Storage {
    /// The values of delivery, and those stored by a drive that was switched off since.
    pub(super) fn new(factory: &Objects, stored: &Objects, save_ns: u64) -> Self {
        let (factory, stored) = (factory.clone(), stored.clone());
        Self { stored, factory, save_ns, saved_at_ns: None, has_changed: false }
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
        self.end_saving(now_ns, objects);
    }

    /// Ends the saving when it is time.
    pub(super) fn end_saving(&mut self, now_ns: u64, objects: &mut Objects) {
        if self.saved_at_ns.take_if(|saved_at_ns| now_ns >= *saved_at_ns).is_some() {
            objects.set(names::SAVE_ALL, SAVES_ON_COMMAND);
            self.store(objects);
        }
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
