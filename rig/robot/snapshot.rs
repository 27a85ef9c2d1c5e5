//! What was read of a drive, as a device configuration file (CiA 306): other tools read it, and so does `drive_profile.dcf`.

use std::collections::BTreeMap;
use std::fmt::Write;

use masseter_can::canopen::ObjectAddress;
use masseter_plant::bringup::{Survey, object_name};

/// Objects that CiA 301 makes mandatory.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];

/// The file. It has the objects that were read and no others.
pub(crate) fn dcf(survey: &Survey, node: u8, name: &str) -> String {
    let mut objects: BTreeMap<u16, Vec<(u8, &[u8])>> = BTreeMap::new();
    for (ObjectAddress { index, subindex }, value) in survey.readings() {
        if let Ok(value) = value {
            objects.entry(index).or_default().push((subindex, value));
        }
    }
    let mut text = format!(
        "[FileInfo]\nFileName={name}.dcf\nDescription=Read by masseter robot inspect\n\n\
         [DeviceComissioning]\nNodeID={node}\nNodeName={name}\n\n"
    );
    let is_of_maker = |index: u16| (0x2000..0x6000).contains(&index);
    for (list, belongs) in [
        ("MandatoryObjects", &(|index| MANDATORY.contains(&index)) as &dyn Fn(u16) -> bool),
        ("OptionalObjects", &|index| !MANDATORY.contains(&index) && !is_of_maker(index)),
        ("ManufacturerObjects", &is_of_maker),
    ] {
        let listed: Vec<_> = objects.keys().filter(|&&index| belongs(index)).collect();
        let _ = writeln!(text, "[{list}]\nSupportedObjects={}", listed.len());
        for (number, index) in (1..).zip(listed) {
            let _ = writeln!(text, "{number}=0x{index:04X}");
        }
        text.push('\n');
    }
    for (index, entries) in objects {
        if let [(0, value)] = entries[..] {
            let _ = write!(text, "[{index:04X}]\n{}", entry(ObjectAddress::new(index, 0), value));
            continue;
        }
        let _ = write!(text, "[{index:04X}]\nParameterName={index:04X}h\nObjectType=0x9\n");
        let _ = write!(text, "SubNumber={}\n\n", entries.len());
        for (subindex, value) in entries {
            let object = ObjectAddress::new(index, subindex);
            let _ = write!(text, "[{index:04X}sub{subindex:X}]\n{}", entry(object, value));
        }
    }
    text
}

fn entry(object: ObjectAddress, value: &[u8]) -> String {
    let number = value.iter().rfold(0u64, |number, &byte| number << 8 | u64::from(byte));
    let (kind, value) = match value.len() {
        1 => (5, format!("0x{number:02X}")),
        2 => (6, format!("0x{number:04X}")),
        4 => (7, format!("0x{number:08X}")),
        _ => (9, String::from_utf8_lossy(value).trim_end_matches('\0').replace(['\r', '\n'], " ")),
    };
    let name = match object_name(object) {
        "" => object.to_string(),
        name => name.to_owned(),
    };
    format!(
        "ParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\nPDOMapping=0\nParameterValue={value}\n\n"
    )
}
