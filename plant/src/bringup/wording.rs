//! Objects and their values in words.

use masseter_can::canopen::ObjectAddress;

use crate::drive::dictionary::{ENTRIES, find};

/// Objects that the emulated drives do not have.
const FURTHER: [(u16, u8, &str); 2] =
    [(0x30B0, 0, "Home position"), (0x30B1, 0, "Home offset move distance")];

/// Name of an object; empty where the rig knows none.
pub fn object_name(object: ObjectAddress) -> &'static str {
    let further =
        || FURTHER.iter().find(|(index, subindex, _)| ObjectAddress::new(*index, *subindex) == object);
    match find(object) {
        Ok(place) => ENTRIES[place].name,
        Err(_) => further().map_or("", |(_, _, name)| name),
    }
}

/// An object's value as its type shows it: identifiers and units in hexadecimal digits, quantities in decimal ones.
pub fn value_text(object: ObjectAddress, value: u32) -> String {
    if is_code(object) {
        return format!("{value:X}h");
    }
    match find(object) {
        Ok(place) => ENTRIES[place].kind.number(value).to_string(),
        Err(_) if object.index == 0x30B0 => (value as i32).to_string(),
        Err(_) => value.to_string(),
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
        ] {
            assert_eq!(value_text(ObjectAddress::new(index, subindex), value), text);
        }
        assert_eq!(object_name(ObjectAddress::new(0x6066, 0)), "Following error time out");
        assert_eq!(object_name(ObjectAddress::new(0x6091, 1)), "Motor revolutions");
        assert_eq!(object_name(ObjectAddress::new(0x2000, 0)), "");
    }
}
