//! Descriptions of drives for other tools. The electronic data sheet of an emulated drive (EDS, CiA 306) and the
//! messages of all buses (DBC) follow from the emulated drives' object dictionary. A device configuration file (DCF,
//! CiA 306) holds the survey of a drive.
//!
//! A description is that of one scenario: the scenario's values are its default values, scales and identifiers.
//! Positions in the DBC are in metres, forces in newtons; segments of SDO are not decoded.

use std::collections::BTreeMap;

use masseter_can::CanId;
use masseter_can::canopen::{Cob, CobId, NmtCommand, NmtState, NodeId, ObjectAddress};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{MASTER_NODE, Scenario};

use crate::commissioning::{Survey, object_name};
use crate::error::PlantError;
use crate::simulator::drive::dictionary::{ENTRIES, Objects, Overlay, find};
use crate::simulator::drive::names;
use crate::simulator::drive::table::{Access, Entry, Initial, Mapping, OBJECTS, Object, PDOS, Shape};
use crate::simulator::drive::{DriveSettings, Ratings};
use crate::simulator::emulation::drives::drive_settings;

/// The electronic data sheets of the drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let [d1, ..] = masseter_plant::description::eds(&masseter_scenario::Scenario::default())?;
/// assert!(d1.contains("ParameterName=Controlword"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn eds(scenario: &Scenario) -> Result<[String; AXES], PlantError> {
    Ok(drive_settings(scenario)?.map(|settings| write_eds(&settings)))
}

/// The messages between the master and all drives as a DBC file.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let dbc = masseter_plant::description::dbc(&masseter_scenario::Scenario::default())?;
/// assert!(dbc.contains("BO_ 385 d1_TPDO1: 8 d1"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn dbc(scenario: &Scenario) -> Result<String, PlantError> {
    Ok(write_dbc(&drive_settings(scenario)?, scenario.period_ns()))
}

const MASTER: &str = "Master";
/// Receiver of messages to all nodes.
const ANYBODY: &str = "Vector__XXX";

/// A signal of a message, little endian, behind the previous signal.
struct Signal {
    name: String,
    bits: usize,
    is_signed: bool,
    factor: f64,
    unit: &'static str,
    /// Lowest and highest value in that unit; none if every value is possible.
    range: Option<[f64; 2]>,
}

/// Numbers without a unit.
fn numbers<const N: usize>(signals: [(&str, usize); N]) -> Vec<Signal> {
    let number = |(name, bits): (&str, _)| Signal {
        name: name.into(),
        bits,
        is_signed: false,
        factor: 1.0,
        unit: "",
        range: None,
    };
    signals.map(number).into()
}

/// The file, lines ended by a line feed.
fn write_dbc(drives: &[DriveSettings; AXES], period_ns: u64) -> String {
    let to_all = [MASTER, ANYBODY];
    let mut parts = vec![
        format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {MASTER} {}\n\n", AXIS_NAMES.join(" ")),
        message(Cob::Nmt.into(), "NMT", to_all, &numbers([("Command", 8), ("Node", 8)])),
        message(Cob::Sync.into(), "SYNC", to_all, &[]),
        message(Cob::Heartbeat(MASTER_NODE).into(), "Master_heartbeat", to_all, &numbers([("State", 8)])),
    ];
    for (settings, name) in drives.iter().zip(AXIS_NAMES) {
        parts.extend(services(settings.node, name));
        parts.extend(process_data(settings, name));
    }
    parts.push(cycle_times(drives, period_ns));
    parts.push(values(Cob::Nmt, "Command", &NmtCommand::ALL.map(|command| (command.code(), command.name()))));
    let states = NmtState::ALL.map(|state| (state.code(), state.name()));
    let nodes = [MASTER_NODE].into_iter().chain(drives.iter().map(|settings| settings.node));
    parts.extend(nodes.map(|node| values(Cob::Heartbeat(node), "State", &states)));
    parts.concat()
}

/// The messages of a node in the predefined connection set.
fn services(node: NodeId, name: &str) -> [String; 4] {
    let (to_master, from_master) = ([name, MASTER], [MASTER, name]);
    let emergency = numbers([("Error_code", 16), ("Error_register", 8), ("Vendor", 40)]);
    let sdo = numbers([("Command", 8), ("Index", 16), ("Subindex", 8), ("Data", 32)]);
    [
        message(Cob::Emergency(node).into(), &format!("{name}_EMCY"), to_master, &emergency),
        message(Cob::SdoResponse(node).into(), &format!("{name}_SDO_response"), to_master, &sdo),
        message(Cob::SdoRequest(node).into(), &format!("{name}_SDO_request"), from_master, &sdo),
        message(
            Cob::Heartbeat(node).into(),
            &format!("{name}_heartbeat"),
            to_master,
            &numbers([("State", 8)]),
        ),
    ]
}

/// The PDOs that exist after power-on.
fn process_data(settings: &DriveSettings, name: &str) -> Vec<String> {
    let mut messages = Vec::new();
    for number in 0..PDOS as u16 {
        let rpdo = ("RPDO", 0x1400, [MASTER, name]);
        for (direction, communication, nodes) in [rpdo, ("TPDO", 0x1800, [name, MASTER])] {
            let cob_id = CobId(settings.objects.at(communication + number, 1));
            let Some(id) = cob_id.identifier() else { continue };
            let signals = mapped(&settings.objects, communication + 0x0200 + number, &settings.drive);
            messages.push(message(id, &format!("{name}_{direction}{}", number + 1), nodes, &signals));
        }
    }
    messages
}

fn mapped(objects: &Objects, index: u16, drive: &Ratings) -> Vec<Signal> {
    let signal = |place: usize| {
        let entry = &ENTRIES[place];
        let (factor, unit, limits) = match entry.address.index {
            0x6064 | 0x607A => {
                let ends = [names::MIN_POSITION_LIMIT, names::MAX_POSITION_LIMIT];
                (drive.encoder_resolution_m, "m", Some(ends.map(|end| f64::from(objects.get(end)))))
            }
            0x6077 | 0x60B2 => {
                let most = f64::from(objects.get(names::MAX_TORQUE));
                (drive.rated_force_n / 1000.0, "N", Some([-most, most]))
            }
            _ => (1.0, "", entry.limits.map(|(lowest, highest)| [lowest as f64, highest as f64])),
        };
        let range = limits.map(|limits| limits.map(|limit| rounded(limit * factor)));
        let (name, bits) = (entry.name.replace(' ', "_"), 8 * entry.kind.bytes());
        Signal { name, bits, is_signed: entry.kind.is_signed(), factor, unit, range }
    };
    objects.mapped(index).map(signal).collect()
}

/// Without the last digits of a product: 0.36 instead of 0.36000000000000004.
fn rounded(value: f64) -> f64 {
    (value * 1e12).round() / 1e12
}

fn message(id: CanId, name: &str, [sender, receiver]: [&str; 2], signals: &[Signal]) -> String {
    let (mut lines, mut start) = (Vec::new(), 0);
    for Signal { name, bits, is_signed, factor, unit, range } in signals {
        let sign = if *is_signed { '-' } else { '+' };
        let place = format!("{start}|{bits}@1{sign}");
        let [lowest, highest] = range.unwrap_or_default();
        let scale = format!("({factor},0) [{lowest}|{highest}]");
        lines.push(format!(" SG_ {name} : {place} {scale} \"{unit}\" {receiver}\n"));
        start += bits;
    }
    format!("BO_ {} {name}: {} {sender}\n{}\n", id.number(), start / 8, lines.concat())
}

/// Periods of regular messages, ms: heartbeats, and SYNC with its PDOs. The format has whole milliseconds only, so a
/// faster SYNC has no period.
fn cycle_times(drives: &[DriveSettings; AXES], period_ns: u64) -> String {
    let heartbeat_ms =
        |settings: &DriveSettings| u64::from(settings.objects.get(names::PRODUCER_HEARTBEAT_TIME_MS));
    let mut times = vec![(CanId::from(Cob::Sync), period_ns / MILLISECOND_NS)];
    times.push((Cob::Heartbeat(MASTER_NODE).into(), heartbeat_ms(&drives[0])));
    for settings in drives {
        times.push((Cob::Heartbeat(settings.node).into(), heartbeat_ms(settings)));
        let communications = (0..PDOS as u16).flat_map(|number| [0x1400 + number, 0x1800 + number]);
        times.extend(communications.filter_map(|communication| {
            let id = CobId(settings.objects.at(communication, 1)).identifier()?;
            let every = u64::from(settings.objects.at(communication, 2));
            (1..=240).contains(&every).then_some((id, every * period_ns / MILLISECOND_NS))
        }));
    }
    let head = "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n";
    let whole = times.into_iter().filter(|(_, ms)| *ms > 0);
    let lines = whole.map(|(id, ms)| format!("BA_ \"GenMsgCycleTime\" BO_ {} {ms};\n", id.number()));
    head.to_owned() + &lines.collect::<String>()
}

/// Names of the values of a signal.
fn values(cob: Cob, signal: &str, names: &[(u8, &str)]) -> String {
    let names: Vec<_> = names.iter().map(|(value, name)| format!("{value} \"{name}\"")).collect();
    format!("VAL_ {} {signal} {} ;\n", CanId::from(cob).number(), names.join(" "))
}

/// Mandatory objects of CiA 301.
const MANDATORY: [u16; 3] = [0x1000, 0x1001, 0x1018];

/// The file, lines ended by a line feed.
fn write_eds(settings: &DriveSettings) -> String {
    let overlay = &settings.quirks.overlay;
    let there: Vec<_> = OBJECTS.iter().filter(|object| !entries(object, overlay).is_empty()).collect();
    let lists = lists(there.iter().map(|object| object.index()));
    let sections = there.iter().map(|object| section(object, &entries(object, overlay), &settings.objects));
    [head(settings.node, &settings.objects), lists].into_iter().chain(sections).collect()
}

/// The sections on the file and the device.
fn head(node: NodeId, objects: &Objects) -> String {
    format!(
        include_str!("description/eds_head.txt"),
        node = node,
        version = env!("CARGO_PKG_VERSION"),
        vendor = objects.at(0x1018, 1),
        product = objects.at(0x1018, 2),
        revision = objects.at(0x1018, 3),
        pdos = PDOS,
    )
}

/// The three lists of objects.
fn lists(indices: impl Iterator<Item = u16>) -> String {
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

/// The survey of a drive as a device configuration file (CiA 306), without other objects.
pub fn dcf(survey: &Survey, node: u8, name: &str) -> String {
    let mut objects: BTreeMap<u16, Vec<(ObjectAddress, &[u8])>> = BTreeMap::new();
    for (object, value) in survey.readings() {
        if let Ok(value) = value {
            objects.entry(object.index).or_default().push((object, value));
        }
    }
    let head = format!(
        "[FileInfo]\nFileName={name}.dcf\nDescription=Read by masseter robot inspect\n\n\
         [DeviceComissioning]\nNodeID={node}\nNodeName={name}\n\n"
    );
    let lists = lists(objects.keys().copied());
    let sections = objects.iter().map(|(index, entries)| match entries[..] {
        [(object, value)] if object.subindex == 0 => format!("[{index:04X}]\n{}", read_entry(object, value)),
        _ => {
            let sub = |&(object, value): &(ObjectAddress, &[u8])| {
                format!("[{index:04X}sub{:X}]\n{}", object.subindex, read_entry(object, value))
            };
            let (count, subs) = (entries.len(), entries.iter().map(sub).collect::<String>());
            format!("[{index:04X}]\nParameterName={index:04X}h\nObjectType=0x9\nSubNumber={count}\n\n{subs}")
        }
    });
    [head, lists].into_iter().chain(sections).collect()
}

fn read_entry(object: ObjectAddress, value: &[u8]) -> String {
    let number = value.iter().rfold(0u64, |number, &byte| number << 8 | u64::from(byte));
    let (kind, value) = match value.len() {
        1 => (5, format!("0x{number:02X}")),
        2 => (6, format!("0x{number:04X}")),
        3 => (0x16, format!("0x{number:06X}")),
        4 => (7, format!("0x{number:08X}")),
        _ => (9, String::from_utf8_lossy(value).trim_end_matches('\0').replace(['\r', '\n'], " ")),
    };
    let name = match object_name(object) {
        "" => object.to_string(),
        name => name.to_owned(),
    };
    format!(
        "ParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\nPDOMapping=0\n\
         ParameterValue={value}\n\n"
    )
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::dcf::{self, Dcf};
    use masseter_scenario::{QuirkConfig, QuirkKindConfig};

    use super::*;
    use crate::simulator::drive::dictionary::ENTRIES;
    use crate::simulator::drive::table::{Access, Initial, Mapping, OBJECTS};

    #[test]
    fn a_sheet_has_every_object_and_every_entry_once() {
        let [first, ..] = eds(&Scenario::default()).unwrap();
        for object in OBJECTS {
            let heading = format!("[{:04X}]\n", object.index());
            assert_eq!(first.matches(&heading).count(), 1, "{heading}");
        }
        let headings = first.matches("AccessType=").count();
        assert_eq!(headings, ENTRIES.len());
    }

    #[test]
    fn a_reader_of_sheets_finds_every_entry_as_it_is_in_the_dictionary() {
        let settings = drive_settings(&Scenario::default()).unwrap();
        for settings in &settings {
            let sheet = Dcf::parse(&write_eds(settings)).unwrap();
            let mut entries: Vec<_> = ENTRIES.iter().collect();
            entries.sort_by_key(|entry| (entry.address.index, entry.address.subindex));
            assert_eq!(sheet.entries().len(), entries.len());
            for (read, entry) in sheet.entries().zip(entries) {
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
                let number =
                    |value: &Option<dcf::Value>| value.as_ref().and_then(|v| v.number(settings.node));
                let limits = entry.limits.map(|(lowest, highest)| (lowest.into(), highest.into()));
                assert_eq!(number(&read.lowest).zip(number(&read.highest)), limits, "{at}");
                let default = read.default.as_ref().unwrap();
                if let Initial::Text(text) = entry.initial {
                    assert_eq!(default, &dcf::Value::Text(text.to_owned()), "{at}");
                } else {
                    let written = settings.objects.at(at.index, at.subindex).to_le_bytes();
                    let bytes = default.number(settings.node).unwrap().to_le_bytes();
                    let length = entry.kind.bytes();
                    assert_eq!(bytes[..length], written[..length], "{at}");
                }
            }
        }
    }

    #[test]
    fn a_sheet_lists_what_the_drive_lets_clients_read() {
        let mut scenario = Scenario::default();
        scenario.drives.quirk = vec![QuirkConfig {
            axes: Some(vec!["d1".to_owned()]),
            ..QuirkConfig::new(QuirkKindConfig::MissingObjects)
        }];
        let [d1, d2, ..] = eds(&scenario).unwrap();
        for index in ["6007", "6066", "6085"] {
            assert!(!d1.contains(&format!("[{index}]")) && !d1.contains(&format!("=0x{index}\n")), "{index}");
            assert!(d2.contains(&format!("[{index}]")) && d2.contains(&format!("=0x{index}\n")), "{index}");
        }
        assert_eq!(d1.matches("AccessType=").count(), ENTRIES.len() - 3);
    }

    #[test]
    fn messages_have_ranges_and_cycle_times() {
        let dbc = dbc(&Scenario::default()).unwrap();
        for line in [
            " SG_ Position_actual_value : 16|32@1- (0.000001,0) [0.24|0.3] \"m\" Master\n",
            " SG_ Torque_actual_value : 48|16@1- (0.5,0) [-1000|1000] \"N\" Master\n",
            "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 128 1;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 388 1;\n",
            "BA_ \"GenMsgCycleTime\" BO_ 1796 50;\n",
        ] {
            assert!(dbc.contains(line), "{line}");
        }
        let fast = super::dbc(&Scenario { rate_hz: 2000, ..Scenario::default() }).unwrap();
        assert!(!fast.contains("Time\" BO_ 128 "), "half a millisecond cannot be said");
    }

    #[test]
    fn sheets_follow_the_scenario() {
        let mut scenario = Scenario::default();
        scenario.can.node_ids = [11, 12, 13, 14, 15, 16];
        scenario.can.heartbeat_producer_ms = 70;
        let [first, ..] = eds(&scenario).unwrap();
        assert!(first.contains("FileName=drive11.eds"));
        assert!(first.contains("[1017]\nParameterName=Producer heartbeat time\nObjectType=0x7\nDataType=0x0006\nAccessType=rw\nDefaultValue=0x46\n"));
        assert!(dbc(&scenario).unwrap().contains("BO_ 395 d1_TPDO1: 8 d1"));
        scenario.can.node_ids[1] = 11;
        assert!(dbc(&scenario).is_err());
    }
}
