//! Objects, their values, and the reasons for their absence in words.

use masseter_can::canopen::{AbortCode, ObjectAddress};
use masseter_drives::entry;
use masseter_plant::sdo::SdoReason;

/// Why the read of an object fails.
pub fn reason_text(reason: SdoReason) -> String {
    match reason {
        SdoReason::Aborted(AbortCode::NO_OBJECT | AbortCode::NO_SUBINDEX) => "not there".to_owned(),
        reason => reason.to_string(),
    }
}

/// Objects that the emulated drives do not have.
const FURTHER: [(u16, u8, &str); 2] =
    [(0x30B0, 0, "Home position"), (0x30B1, 0, "Home offset move distance")];

/// Name of an object; empty for one that the rig does not use.
pub fn object_name(object: ObjectAddress) -> &'static str {
    let further =
        || FURTHER.iter().find(|(index, subindex, _)| ObjectAddress::new(*index, *subindex) == object);
    match entry(object) {
        Some(entry) => entry.name,
        None => further().map_or("", |(_, _, name)| name),
    }
}

/// An object's value by its type: identifiers and units in hexadecimal digits, quantities in decimal digits.
pub fn value_text(object: ObjectAddress, value: u32) -> String {
    if is_code(object) {
        return format!("{value:X}h");
    }
    match entry(object) {
        Some(entry) => entry.kind.number(value).to_string(),
        None if object.index == 0x30B0 => (value as i32).to_string(),
        // Nobody knows whether such an object has a sign.
        None if value > i32::MAX as u32 => format!("{value} (with a sign {})", value as i32),
        None => value.to_string(),
    }
}

fn is_code(ObjectAddress { index, subindex }: ObjectAddress) -> bool {
    match index {
        0x1400..=0x15FF | 0x1800..=0x19FF => subindex == 1,
        0x1600..=0x17FF | 0x1A00..=0x1BFF => subindex > 0,
        0x1017 => false,
        0x1000..=0x1FFF | 0x603F | 0x6041 | 0x60A8..=0x60AA | 0x6502 => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_show_as_what_they_are() {
        for (index, subindex, value, text) in [
            (0x1800, 1, 0x4000_0181, "40000181h"),
            (0x1800, 2, 255, "255"),
            (0x1A00, 1, 0x6041_0010, "60410010h"),
            (0x607D, 1, -5i32 as u32, "-5"),
            (0x60C2, 2, 0xFD, "-3"),
            (0x60AA, 0, 0x00C0_0300, "C00300h"),
            (0x30B0, 0, u32::MAX, "-1"),
            (0x2FFF, 0, -5i32 as u32, "4294967291 (with a sign -5)"),
            (0x2FFF, 0, 5, "5"),
        ] {
            assert_eq!(value_text(ObjectAddress::new(index, subindex), value), text);
        }
        assert_eq!(object_name(ObjectAddress::new(0x6066, 0)), "Following error time out");
        assert_eq!(object_name(ObjectAddress::new(0x6091, 1)), "Motor revolutions");
        assert_eq!(object_name(ObjectAddress::new(0x2000, 0)), "");
    }
}
