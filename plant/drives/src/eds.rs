//! The electronic data sheet of a drive (EDS, CiA 306), which follows from its object dictionary.
//!
//! The values of the settings are the sheet's default values.

use masseter_can::canopen::NodeId;

use crate::dictionary::{Objects, Overlay, find};
use crate::quirks::Delivered;
use crate::settings::{DriveSettings, SettingsError};
use crate::table::{Access, DataType, Entry, Initial, Mapping, OBJECTS, Object, PDOS, Shape};

/// Mandatory objects of CiA 301.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];

/// The electronic data sheet of a drive, lines ended by a line feed.
///
/// # Errors
/// [`SettingsError::Quirk`].
///
/// ```
/// use masseter_can::canopen::NodeId;
/// use masseter_drives::{DriveSettings, eds};
///
/// let sheet = eds(&DriveSettings::new(NodeId::new(4)?))?;
/// assert!(sheet.contains("ParameterName=Controlword"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn eds(settings: &DriveSettings) -> Result<String, SettingsError> {
    let Delivered { objects, overlay, .. } = settings.delivered()?;
    let there: Vec<_> = OBJECTS.iter().filter(|object| !entries(object, &overlay).is_empty()).collect();
    let lists = object_lists(there.iter().map(|object| object.index()));
    let sections = there.iter().map(|object| section(object, &entries(object, &overlay), &objects));
    Ok([head(settings.node, &objects), lists].into_iter().chain(sections).collect())
}

/// The sections on the file and the device.
fn head(node: NodeId, objects: &Objects) -> String {
    format!(
        include_str!("eds_head.txt"),
        node = node,
        version = env!("CARGO_PKG_VERSION"),
        vendor = objects.at(0x1018, 1),
        product = objects.at(0x1018, 2),
        revision = objects.at(0x1018, 3),
        pdos = PDOS,
    )
}

/// The lists of mandatory, optional and the maker's objects in an EDS or a DCF.
pub fn object_lists(indices: impl Iterator<Item = u16>) -> String {
    let (of_maker, standard): (Vec<_>, Vec<_>) = indices.partition(|index| (0x2000..0x6000).contains(index));
    let (mandatory, optional): (Vec<_>, Vec<_>) =
        standard.into_iter().partition(|index| MANDATORY.contains(index));
    let list = |(section, indices): (&str, Vec<u16>)| {
        let line = |(number, index): (usize, &u16)| format!("{number}=0x{index:04X}\n");
        let lines: String = (1..).zip(&indices).map(line).collect();
        format!("[{section}]\nSupportedObjects={}\n{lines}\n", indices.len())
    };
    [("MandatoryObjects", mandatory), ("OptionalObjects", optional), ("ManufacturerObjects", of_maker)]
        .map(list)
        .concat()
}

/// The entries of an object that the drive has.
fn entries(object: &Object, overlay: &Overlay) -> Vec<Entry> {
    let of_drive = |entry: &Entry| overlay.entry(find(entry.address).ok()?);
    object.entries.iter().filter_map(of_drive).collect()
}

fn section(object: &Object, entries: &[Entry], objects: &Objects) -> String {
    let (index, Object { name, shape, .. }) = (object.index(), object);
    let kind = match shape {
        Shape::Var => return format!("[{index:04X}]\n{}", describe(&entries[0], objects)),
        Shape::Array => 0x8,
        Shape::Record => 0x9,
    };
    let sub =
        |entry: &Entry| format!("[{index:04X}sub{:X}]\n{}", entry.address.subindex, describe(entry, objects));
    let (count, subs) = (entries.len(), entries.iter().map(sub).collect::<String>());
    format!("[{index:04X}]\nParameterName={name}\nObjectType=0x{kind:X}\nSubNumber={count}\n\n{subs}")
}

fn describe(entry: &Entry, objects: &Objects) -> String {
    let access = match entry.access {
        Access::Constant => "const",
        Access::ReadOnly => "ro",
        Access::ReadWrite => "rw",
    };
    let (name, kind, mapping) = (entry.name, entry.kind as u16, u8::from(entry.mapping != Mapping::Never));
    let number = entry.kind.number(objects.at(entry.address.index, entry.address.subindex));
    let value = match entry.initial {
        Initial::Text(text) => text.to_owned(),
        Initial::Empty => String::new(),
        Initial::OfNode(base) => format!("$NODEID+0x{base:X}"),
        _ if entry.kind.is_signed() => number.to_string(),
        _ => format!("0x{number:X}"),
    };
    let limits = entry
        .limits
        .map_or_else(String::new, |(lowest, highest)| format!("LowLimit={lowest}\nHighLimit={highest}\n"));
    let shape = if entry.kind == DataType::Domain { 0x2 } else { 0x7 };
    format!(
        "ParameterName={name}\nObjectType=0x{shape:X}\nDataType=0x{kind:04X}\nAccessType={access}\n\
         DefaultValue={value}\nPDOMapping={mapping}\n{limits}\n"
    )
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::dcf::{self, Dcf};

    use super::*;
    use crate::dictionary::ENTRIES;
    use crate::quirks::Quirk;

    fn settings() -> DriveSettings {
        DriveSettings::new(NodeId::new(4).unwrap())
    }

    #[test]
    fn a_sheet_has_every_object_and_every_entry_once() {
        let sheet = eds(&settings()).unwrap();
        for object in OBJECTS {
            let heading = format!("[{:04X}]\n", object.index());
            assert_eq!(sheet.matches(&heading).count(), 1, "{heading}");
        }
        assert_eq!(sheet.matches("AccessType=").count(), ENTRIES.len());
    }

    #[test]
    fn a_reader_of_sheets_finds_every_entry_as_it_is_in_the_dictionary() {
        let settings = settings();
        let (objects, sheet) = (settings.objects().unwrap(), Dcf::parse(&eds(&settings).unwrap()).unwrap());
        assert_eq!(sheet.entries().len(), ENTRIES.len());
        for (read, entry) in sheet.entries().zip(&ENTRIES) {
            let at = entry.address;
            assert_eq!((read.address, read.name.as_str()), (at, entry.name));
            assert_eq!(read.data_type.0, entry.kind as u16, "{at}");
            assert_eq!(read.is_mappable, entry.mapping != Mapping::Never, "{at}");
            let access = match entry.access {
                Access::Constant => dcf::Access::Constant,
                Access::ReadOnly => dcf::Access::ReadOnly,
                Access::ReadWrite => dcf::Access::ReadWrite,
            };
            assert_eq!(read.access, access, "{at}");
            let number = |value: &Option<dcf::Value>| value.as_ref().and_then(|v| v.number(settings.node));
            let limits = entry.limits.map(|(lowest, highest)| (lowest.into(), highest.into()));
            assert_eq!(number(&read.lowest).zip(number(&read.highest)), limits, "{at}");
            let default = read.default.as_ref();
            if let Initial::Text(text) = entry.initial {
                assert_eq!(default, Some(&dcf::Value::Text(text.to_owned())), "{at}");
            } else if entry.initial == Initial::Empty {
                assert_eq!((default, read.data_type), (None, dcf::DataType::DOMAIN), "{at}");
            } else {
                let written = objects.at(at.index, at.subindex).to_le_bytes();
                let bytes = default.unwrap().number(settings.node).unwrap().to_le_bytes();
                let length = entry.kind.bytes();
                assert_eq!(bytes[..length], written[..length], "{at}");
            }
        }
    }

    #[test]
    fn a_sheet_lists_what_the_drive_lets_clients_read() {
        let plain = eds(&settings()).unwrap();
        let lacking = eds(&DriveSettings { quirks: vec![Quirk::MissingObjects], ..settings() }).unwrap();
        for index in ["6007", "6066", "6085"] {
            let has = |sheet: &str| {
                [format!("[{index}]"), format!("=0x{index}\n")].map(|text| sheet.contains(&text))
            };
            assert_eq!((has(&plain), has(&lacking)), ([true; 2], [false; 2]), "{index}");
        }
        assert_eq!(lacking.matches("AccessType=").count(), ENTRIES.len() - 3);
    }
}
