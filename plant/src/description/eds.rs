//! An electronic data sheet as CiA 306 lays it out.

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
    let objects = settings.objects();
    let (mandatory, optional): (Vec<_>, Vec<_>) =
        OBJECTS.iter().partition(|object| MANDATORY.contains(&object.index));
    let mut parts = vec![file_info(settings.node), device_info()];
    parts.push(list("MandatoryObjects", &mandatory));
    parts.push(list("OptionalObjects", &optional));
    parts.push(list("ManufacturerObjects", &[]));
    parts.extend(OBJECTS.iter().map(|object| section(object, &objects)));
    parts.concat()
}

fn file_info(node: NodeId) -> String {
    format!(
        "[FileInfo]\nFileName=drive{node}.eds\nFileVersion=1\nFileRevision=0\nEDSVersion=4.0\n\
         Description=Emulated CiA 402 servo drive\nCreatedBy=Masseter {}\n\n",
        env!("CARGO_PKG_VERSION")
    )
}

fn device_info() -> String {
    let IdentityConfig { vendor_id, product_code, revision, .. } = IDENTITY;
    format!(
        "[DeviceInfo]\nVendorName=Masseter\nVendorNumber=0x{vendor_id:08X}\n\
         ProductName=Masseter emulated drive\nProductNumber=0x{product_code:08X}\nRevisionNumber=0x{revision:08X}\n\
         BaudRate_10=1\nBaudRate_20=1\nBaudRate_50=1\nBaudRate_125=1\nBaudRate_250=1\nBaudRate_500=1\n\
         BaudRate_800=1\nBaudRate_1000=1\nSimpleBootUpMaster=0\nSimpleBootUpSlave=1\nGranularity=8\n\
         DynamicChannelsSupported=0\nGroupMessaging=0\nNrOfRXPDO={PDOS}\nNrOfTXPDO={PDOS}\nLSS_Supported=0\n\n\
         [DummyUsage]\nDummy0001=0\nDummy0002=0\nDummy0003=0\nDummy0004=0\nDummy0005=0\nDummy0006=0\nDummy0007=0\n\n\
         [Comments]\nLines=0\n\n"
    )
}

fn list(section: &str, objects: &[&Object]) -> String {
    let line = |(number, object): (usize, &&Object)| format!("{number}=0x{:04X}\n", object.index);
    let lines: Vec<_> = (1..).zip(objects).map(line).collect();
    format!("[{section}]\nSupportedObjects={}\n{}\n", objects.len(), lines.concat())
}

fn section(object: &Object, objects: &Objects) -> String {
    let Object { index, name, shape, entries } = object;
    let kind = match shape {
        Shape::Var => return format!("[{index:04X}]\n{}", describe(*index, &entries[0], objects)),
        Shape::Array => 0x8,
        Shape::Record => 0x9,
    };
    let sub =
        |entry: &Entry| format!("[{index:04X}sub{:X}]\n{}", entry.subindex, describe(*index, entry, objects));
    let (count, subs) = (entries.len(), entries.iter().map(sub).collect::<Vec<_>>().concat());
    format!("[{index:04X}]\nParameterName={name}\nObjectType=0x{kind:X}\nSubNumber={count}\n\n{subs}")
}

fn describe(index: u16, entry: &Entry, objects: &Objects) -> String {
    let access = match entry.access {
        Access::Constant => "const",
        Access::ReadOnly => "ro",
        Access::ReadWrite => "rw",
    };
    let (name, kind, mapping) = (entry.name, entry.kind as u16, u8::from(entry.mapping != Mapping::Never));
    let value = default_value(index, entry, objects);
    let limits = entry
        .limits
        .map_or_else(String::new, |(lowest, highest)| format!("LowLimit={lowest}\nHighLimit={highest}\n"));
    format!(
        "ParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType={access}\nDefaultValue={value}\n\
         PDOMapping={mapping}\n{limits}\n"
    )
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
