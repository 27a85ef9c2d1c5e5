//! An electronic data sheet as CiA 306 lays it out.

use std::fmt::{self, Write};

use masseter_can::canopen::NodeId;
use masseter_shared::config::IdentityConfig;

use crate::drive::DriveSettings;
use crate::drive::dictionary::{
    Access, Entry, IDENTITY, Initial, Mapping, OBJECTS, Object, Objects, PDOS, Shape,
};

/// Objects that CiA 301 makes mandatory.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];

/// The file, lines ended by a line feed.
pub(super) fn write(settings: &DriveSettings) -> String {
    let mut text = String::new();
    let written = sections(&mut text, &settings.objects(), settings.node);
    written.expect("text can be added to a string");
    text
}

fn sections(text: &mut String, objects: &Objects, node: NodeId) -> fmt::Result {
    file_info(text, node)?;
    device_info(text)?;
    let is_mandatory = |object: &&Object| MANDATORY.contains(&object.index);
    list(text, "MandatoryObjects", OBJECTS.iter().filter(is_mandatory))?;
    list(text, "OptionalObjects", OBJECTS.iter().filter(|object| !is_mandatory(object)))?;
    list(text, "ManufacturerObjects", [].iter())?;
    OBJECTS.iter().try_for_each(|object| write_object(text, object, objects))
}

fn file_info(text: &mut String, node: NodeId) -> fmt::Result {
    writeln!(
        text,
        "[FileInfo]\nFileName=drive{node}.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n\
         Description=Emulated CiA 402 servo drive\nCreatedBy=Masseter {}\n",
        env!("CARGO_PKG_VERSION")
    )
}

fn device_info(text: &mut String) -> fmt::Result {
    let IdentityConfig { vendor_id, product_code, revision, .. } = IDENTITY;
    writeln!(
        text,
        "[DeviceInfo]\nVendorName=Masseter\nVendorNumber=0x{vendor_id:08X}\n\
         ProductName=Masseter emulated drive\nProductNumber=0x{product_code:08X}\nRevisionNumber=0x{revision:08X}\n\
         BaudRate_10=1\nBaudRate_20=1\nBaudRate_50=1\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\n\
         BaudRate_800=1\nBaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\n\
         DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO={PDOS}\nNrOfTXPDO={PDOS}\nLSS_Supported=0\n"
    )?;
    text.write_str("[DummyUsage]\n")?;
    (1..8).try_for_each(|kind| writeln!(text, "Dummy{kind:04X}=0"))?;
    text.write_str("\n[Comments]\nLines=0\n\n")
}

fn list<'a>(
    text: &mut String,
    section: &str,
    objects: impl Iterator<Item = &'a Object> + Clone,
) -> fmt::Result {
    writeln!(text, "[{section}]\nSupportedObjects={}", objects.clone().count())?;
    for (number, object) in (1..).zip(objects) {
        writeln!(text, "{number}=0x{:04X}", object.index)?;
    }
    writeln!(text)
}

fn write_object(text: &mut String, object: &Object, objects: &Objects) -> fmt::Result {
    let Object { index, name, shape, entries } = object;
    if *shape == Shape::Var {
        writeln!(text, "[{index:04X}]")?;
        return write_entry(text, *index, &entries[0], objects);
    }
    let kind = if *shape == Shape::Array { 0x8 } else { 0x9 };
    writeln!(
        text,
        "[{index:04X}]\nParameterName={name}\nObjectType=0x{kind:X}\nSubNumber={}\n",
        entries.len()
    )?;
    entries.iter().try_for_each(|entry| {
        writeln!(text, "[{index:04X}sub{:X}]", entry.subindex)?;
        write_entry(text, *index, entry, objects)
    })
}

fn write_entry(text: &mut String, index: u16, entry: &Entry, objects: &Objects) -> fmt::Result {
    let access = match entry.access {
        Access::Constant => "const",
        Access::ReadOnly => "ro",
        Access::ReadWrite => "rw",
    };
    let mapping = u8::from(entry.mapping != Mapping::Never);
    writeln!(text, "ParameterName={}\nObjectType=0x7\nDataType=0x{:04X}", entry.name, entry.kind.code())?;
    writeln!(text, "AccessType={access}\nDefaultValue={}", default_value(index, entry, objects))?;
    writeln!(text, "PDOMapping={mapping}")?;
    if let Some((lowest, highest)) = entry.limits {
        writeln!(text, "LowLimit={lowest}\nHighLimit={highest}")?;
    }
    writeln!(text)
}

fn default_value(index: u16, entry: &Entry, objects: &Objects) -> String {
    match entry.initial {
        Initial::Text(text) => text.to_owned(),
        Initial::OfNode(base) => format!("$NODEID+0x{base:X}"),
        Initial::Value(_) | Initial::Configured => {
            let word = objects.at(index, entry.subindex);
            if entry.kind.is_signed() {
                entry.kind.number(word).to_string()
            } else {
                format!("0x{:X}", entry.kind.number(word))
            }
        }
    }
}
