//! Writes that depend on other objects: the mapping procedure of CiA 301 (7.5.2.36 to 38), storage, modes.

use crate::abort::Abort;
use crate::dictionary::{Address, Dictionary};

const NOT_VALID: i64 = 1 << 31;
const EXTENDED: i64 = 1 << 29;
/// Bits of a COB-ID that must stay while its PDO is valid.
const IDENTIFIER: i64 = (1 << 30) - 1;
const PDO_BITS: u32 = 64;
/// `save` and `load`, as numbers.
const SAVE: i64 = 0x6576_6173;
const LOAD: i64 = 0x6461_6F6C;

/// Whether a number that fits the entry may be written now.
pub(crate) fn check(dictionary: &Dictionary, address: Address, number: i64) -> Result<(), Abort> {
    let permitted = |is_permitted: bool, otherwise| if is_permitted { Ok(()) } else { Err(otherwise) };
    match address {
        (0x1003, 0) => permitted(number == 0, Abort::VALUE),
        (0x1010, 1..) => permitted(number == SAVE, Abort::NOT_STORED),
        (0x1011, 1..) => permitted(number == LOAD, Abort::NOT_STORED),
        (index, subindex) if is_communication(index) => {
            check_communication(dictionary, index, subindex, number)
        }
        (index, subindex) if is_mapping(index) => check_mapping(dictionary, index, subindex, number),
        // Modes 1 and above are the bits of 6502h from 0 on.
        (0x6060, 0) if dictionary.has((0x6502, 0)) && number > 0 => {
            permitted(dictionary.number((0x6502, 0)) >> (number - 1) & 1 == 1, Abort::VALUE)
        }
        _ => Ok(()),
    }
}

/// Whether an object describes a PDO.
pub(crate) fn is_of_pdo(index: u16) -> bool {
    is_communication(index) || is_mapping(index)
}

fn is_communication(index: u16) -> bool {
    matches!(index, 0x1400..=0x15FF | 0x1800..=0x19FF)
}

fn is_mapping(index: u16) -> bool {
    matches!(index, 0x1600..=0x17FF | 0x1A00..=0x1BFF)
}

fn check_communication(dictionary: &Dictionary, index: u16, subindex: u8, number: i64) -> Result<(), Abort> {
    let cob_id = dictionary.number((index, 1));
    let is_valid = cob_id & NOT_VALID == 0;
    let becomes_valid = number & NOT_VALID == 0;
    match subindex {
        1 if number & EXTENDED != 0 => Err(Abort::VALUE),
        1 if becomes_valid && is_reserved((number & 0x7FF) as u16) => Err(Abort::VALUE),
        1 if becomes_valid && is_valid && (number ^ cob_id) & IDENTIFIER != 0 => Err(Abort::VALUE),
        2 if matches!(number, 241..=251) => Err(Abort::VALUE),
        3 if is_valid => Err(Abort::DEVICE_STATE),
        _ => Ok(()),
    }
}

/// Identifiers that a PDO must not have (CiA 301, 7.3.5).
fn is_reserved(id: u16) -> bool {
    matches!(id, 0..=0x7F | 0x101..=0x180 | 0x581..=0x5FF | 0x601..=0x67F | 0x6E0..=0x6FF | 0x701..=0x7FF)
}

fn check_mapping(dictionary: &Dictionary, index: u16, subindex: u8, number: i64) -> Result<(), Abort> {
    if dictionary.number((index - 0x200, 1)) & NOT_VALID == 0 {
        return Err(Abort::DEVICE_STATE);
    }
    let is_received = index < 0x1800;
    if subindex > 0 {
        // A mapping that counts is read only.
        if dictionary.number((index, 0)) != 0 {
            return Err(Abort::READ_ONLY);
        }
        return mapped_bits(dictionary, number, is_received).map(drop);
    }
    if number > dictionary.subindices(index).count() as i64 {
        return Err(Abort::PDO_LENGTH);
    }
    let entry = |place| mapped_bits(dictionary, dictionary.number((index, place)), is_received);
    let bits = (1..=number as u8).map(entry).sum::<Result<u32, _>>()?;
    if bits > PDO_BITS { Err(Abort::PDO_LENGTH) } else { Ok(()) }
}

fn mapped_bits(dictionary: &Dictionary, mapped: i64, is_received: bool) -> Result<u32, Abort> {
    let address = ((mapped >> 16) as u16, (mapped >> 8) as u8);
    let bits = dictionary.mappable_bits(address, is_received);
    bits.filter(|bits| i64::from(*bits) == mapped & 0xFF).ok_or(Abort::NOT_MAPPABLE)
}
