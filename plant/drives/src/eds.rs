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

    /// Sections with their keys, in the order of the sheet.
    fn sections(sheet: &str) -> Vec<(&str, Vec<(&str, &str)>)> {
        let mut sections = Vec::new();
        for line in sheet.lines().filter(|line| !line.is_empty()) {
            if let Some(name) = line.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')) {
                sections.push((name, Vec::new()));
            } else {
                let (_, keys) = sections.last_mut().expect("a section before the first key");
                keys.push(line.split_once('=').expect("key=value"));
            }
        }
        sections
    }

    /// CiA 306-1 without a parser of sheets: the sections and keys that it demands, lists that count and name each object
    /// once in the list of its range, and descriptions with the keys of their object type.
    #[test]
    fn a_sheet_keeps_to_the_rules_of_cia_306() {
        let with = |quirk: Quirk| DriveSettings { quirks: vec![quirk], ..settings() };
        for settings in [settings(), with(Quirk::MissingObjects), with(Quirk::FactoryPdos)] {
            let sheet = eds(&settings).unwrap();
            assert!(sheet.is_ascii() && sheet.lines().all(|line| line.len() <= 255));
            let sections = sections(&sheet);
            let keys = |name: &str| &sections.iter().find(|(other, _)| *other == name).expect(name).1;
            let value = |name: &str, key: &str| {
                let values: Vec<_> = keys(name).iter().filter(|(other, _)| *other == key).collect();
                assert_eq!(values.len(), 1, "[{name}] {key}");
                values[0].1
            };
            let number = |text: &str| match text.strip_prefix("0x") {
                Some(digits) => i64::from_str_radix(digits, 16).unwrap(),
                None => text.parse().unwrap(),
            };
            let head = [
                ("FileInfo", "FileName FileVersion FileRevision EDSVersion Description CreatedBy"),
                ("DeviceInfo", "VendorName VendorNumber ProductName ProductNumber RevisionNumber OrderCode"),
                ("DeviceInfo", "BaudRate_10 BaudRate_20 BaudRate_50 BaudRate_125 BaudRate_250 BaudRate_500"),
                ("DeviceInfo", "BaudRate_800 BaudRate_1000 SimpleBootUpMaster SimpleBootUpSlave Granularity"),
                ("DeviceInfo", "DynamicChannelsSupported GroupMessaging NrOfRXPDO NrOfTXPDO LSS_Supported"),
                ("DummyUsage", "Dummy0001 Dummy0002 Dummy0003 Dummy0004 Dummy0005 Dummy0006 Dummy0007"),
                ("Comments", "Lines"),
            ];
            for (section, names) in head {
                names.split(' ').for_each(|name| assert!(!value(section, name).is_empty(), "{name}"));
            }
            assert_eq!(value("FileInfo", "FileName").rsplit_once('.'), Some(("drive4", "eds")));

            let mut listed = Vec::new();
            for (list, holds) in [
                ("MandatoryObjects", (|index| MANDATORY.contains(&index)) as fn(u16) -> bool),
                ("OptionalObjects", |index| {
                    !(0x2000..0x6000).contains(&index) && !MANDATORY.contains(&index)
                }),
                ("ManufacturerObjects", |index| (0x2000..0x6000).contains(&index)),
            ] {
                let count = number(value(list, "SupportedObjects"));
                assert_eq!(keys(list).len() as i64, count + 1, "{list}");
                for place in 1..=count {
                    let index = number(value(list, &place.to_string())) as u16;
                    assert!(holds(index), "{index:04X} in {list}");
                    listed.push(format!("{index:04X}"));
                }
            }
            let is_object = |name: &str| name.len() == 4 && u16::from_str_radix(name, 16).is_ok();
            let mut described: Vec<_> =
                sections.iter().map(|(name, _)| (*name).to_owned()).filter(|name| is_object(name)).collect();
            listed.sort();
            described.sort();
            assert_eq!(listed, described, "every object in one list, and with a section");
            let pdos = |first: char| {
                let index = if first == 'R' { "140" } else { "180" };
                (described.iter().filter(|name| name.starts_with(index)).count(), format!("NrOf{first}XPDO"))
            };
            for (count, key) in [pdos('R'), pdos('T')] {
                assert_eq!(number(value("DeviceInfo", &key)), count as i64);
            }

            for name in &described {
                let subs = sections.iter().filter(|(other, _)| other.starts_with(&format!("{name}sub")));
                let subs: Vec<_> = subs.map(|(other, _)| *other).collect();
                match value(name, "ObjectType") {
                    "0x8" | "0x9" => {
                        assert_eq!(number(value(name, "SubNumber")), subs.len() as i64, "{name}");
                        assert_eq!(value(&format!("{name}sub0"), "DataType"), "0x0005");
                    }
                    _ => assert!(subs.is_empty(), "{name}"),
                }
                for entry in if subs.is_empty() { vec![name.as_str()] } else { subs } {
                    let text = value(entry, "ParameterName");
                    assert!((1..=241).contains(&text.len()), "{entry}");
                    let kind = number(value(entry, "DataType"));
                    let shape = if kind == DataType::Domain as i64 { "0x2" } else { "0x7" };
                    assert_eq!(value(entry, "ObjectType"), shape, "{entry}");
                    assert!(["const", "ro", "rw"].contains(&value(entry, "AccessType")), "{entry}");
                    assert!(["0", "1"].contains(&value(entry, "PDOMapping")), "{entry}");
                    if keys(entry).iter().any(|(key, _)| *key == "LowLimit") {
                        let limits = number(value(entry, "LowLimit"))..=number(value(entry, "HighLimit"));
                        assert!(limits.contains(&number(value(entry, "DefaultValue"))), "{entry}");
                    }
                }
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
