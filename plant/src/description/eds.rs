//! An electronic data sheet as CiA 306 lays it out.

use masseter_can::canopen::NodeId;

use crate::drive::DriveSettings;
use crate::drive::dictionary::{
    Access, Entry, Initial, Mapping, OBJECTS, Object, Objects, Overlay, PDOS, Shape, find,
};

/// Objects that CiA 301 makes mandatory.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];

/// The file, lines ended by a line feed.
pub(super) fn write(settings: &DriveSettings) -> String {
    let overlay = &settings.quirks.overlay;
    let there: Vec<_> = OBJECTS.iter().filter(|object| !entries(object, overlay).is_empty()).collect();
    let (mandatory, optional): (Vec<_>, Vec<_>) =
        there.iter().partition(|object| MANDATORY.contains(&object.index()));
    let lists = [
        list("MandatoryObjects", &mandatory),
        list("OptionalObjects", &optional),
        list("ManufacturerObjects", &[]),
    ];
    let sections = there.iter().map(|object| section(object, &entries(object, overlay), &settings.objects));
    [head(settings.node, &settings.objects)].into_iter().chain(lists).chain(sections).collect()
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

fn list(section: &str, objects: &[&Object]) -> String {
    let line = |(number, object): (usize, &&Object)| format!("{number}=0x{:04X}\n", object.index());
    let lines: String = (1..).zip(objects).map(line).collect();
    format!("[{section}]\nSupportedObjects={}\n{lines}\n", objects.len())
}

/// The entries of an object that the drive has.
fn entries(object: &Object, overlay: &Overlay) -> Vec<Entry> {
    let of_drive = |entry: &Entry| overlay.entry(find(entry.address).ok()?).copied();
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
        Initial::OfNode(base) => format!("$NODEID+0x{base:X}"),
        _ if entry.kind.is_signed() => number.to_string(),
        _ => format!("0x{number:X}"),
    };
    let limits = entry
        .limits
        .map_or_else(String::new, |(lowest, highest)| format!("LowLimit={lowest}\nHighLimit={highest}\n"));
    format!(
        "ParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType={access}\nDefaultValue={value}\n\
         PDOMapping={mapping}\n{limits}\n"
    )
}
