//! Rules for writing an object, beyond type and limits: values without a range, parameters in use, and
//! the procedure of CiA 301 for changing a PDO.
//!
//! The rules only judge; they change nothing.

use masseter_can::canopen::{AbortCode, CobId, ObjectAddress};

use super::heartbeats::consumed_node;
use crate::drive::axis::{Axis, Homing, Mode};
use crate::drive::dictionary::{
    CONSUMED, DataType, MAPPED_MAX, Mapping, MappingEntry, Objects, Overlay, names,
};

/// Signature of 1010h, "save".
const SAVE: u32 = u32::from_le_bytes(*b"save");
/// Signature of 1011h, "load".
const LOAD: u32 = u32::from_le_bytes(*b"load");
/// Bits that a PDO carries at most.
const PDO_BITS: usize = 64;

/// An error unless something is allowed.
fn allow(is_allowed: bool, code: AbortCode) -> Result<(), AbortCode> {
    if is_allowed { Ok(()) } else { Err(code) }
}

/// Whether that word may be written to an entry now.
///
/// # Errors
/// The abort code with the reason.
pub(super) fn check(
    object: ObjectAddress,
    word: u32,
    objects: &Objects,
    axis: &Axis,
    overlay: &Overlay,
    is_operational: bool,
) -> Result<(), AbortCode> {
    let ObjectAddress { index, subindex } = object;
    match index {
        0x1003 => allow(word == 0, AbortCode::INVALID_VALUE),
        0x1010 => {
            allow(word == SAVE, AbortCode::NOT_STORED)?;
            allow(!axis.is_enabled(), AbortCode::DEVICE_STATE)
        }
        0x1011 => allow(word == LOAD, AbortCode::NOT_STORED),
        0x1014 => cob_id(CobId(objects.get(names::EMERGENCY_COB_ID)), CobId(word)),
        0x1016 => allow(!is_consumed_elsewhere(subindex, word, objects), AbortCode::PARAMETER_INCOMPATIBLE),
        0x1019 => {
            allow(word != 1, AbortCode::INVALID_VALUE)?;
            allow(!is_operational, AbortCode::DEVICE_STATE)
        }
        0x1400..0x1600 | 0x1800..0x1A00 => communication(object, word, objects),
        0x1600..0x1800 | 0x1A00..0x1C00 => mapping(object, word, objects, overlay),
        0x605A => allow(!matches!(word, 3 | 4), AbortCode::INVALID_VALUE),
        // 0 leaves the mode as it is.
        0x6060 => {
            allow(word as i8 == 0 || Mode::supported(word as i8, objects).is_some(), AbortCode::INVALID_VALUE)
        }
        0x607D => {
            let (lowest, highest) = match subindex {
                1 => (word as i32, objects.get(names::MAX_POSITION_LIMIT)),
                _ => (objects.get(names::MIN_POSITION_LIMIT), word as i32),
            };
            allow(lowest <= highest, AbortCode::MAXIMUM_BELOW_MINIMUM)
        }
        0x6098 => {
            allow(Homing::is_method(word as i8), AbortCode::INVALID_VALUE)?;
            allow(!axis.is_homing(), AbortCode::DEVICE_STATE)
        }
        0x60C2 => allow(!axis.is_enabled(), AbortCode::DEVICE_STATE),
        _ => Ok(()),
    }
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
    let has_length = object.kind != DataType::Text && object.kind.bytes() * 8 == entry.bits();
    allow(is_allowed && has_length, AbortCode::NOT_MAPPABLE)
}

const _: () = assert!(MAPPED_MAX * 8 == PDO_BITS, "eight bytes hold eight objects at most");
