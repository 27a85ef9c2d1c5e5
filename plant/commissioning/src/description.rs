//! Descriptions of drives for other tools. The electronic data sheets of the emulated drives (EDS, CiA 306) and the
//! messages of all buses (DBC) follow from the emulated drives' object dictionary. A device configuration file (DCF,
//! CiA 306) holds the survey of a drive.
//!
//! A description is that of one scenario: the scenario's values are its default values, scales and identifiers.
//! Positions in the DBC are in metres, forces in newtons; segments of SDO are not decoded.

use std::collections::BTreeMap;

use masseter_can::CanId;
use masseter_can::canopen::{Cob, CobId, NmtCommand, NmtState, NodeId, ObjectAddress};
use masseter_drives::{DriveSettings, Entry, Objects, PDOS, Ratings, object_lists};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_plant::{PlantError, emulation::drive_settings};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{MASTER_NODE, Scenario};

use crate::{object_words::object_name, settings::Survey};

/// The electronic data sheets of the drives, in the order of the axes.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let [d1, ..] = masseter_commissioning::description::eds(&masseter_scenario::Scenario::default())?;
/// assert!(d1.contains("ParameterName=Controlword"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn eds(scenario: &Scenario) -> Result<[String; AXES], PlantError> {
    let sheets = drive_settings(scenario)?.iter().map(masseter_drives::eds).collect::<Result<Vec<_>, _>>()?;
    Ok(sheets.try_into().expect("a sheet for every axis"))
}

/// The messages between the master and all drives as a DBC file.
///
/// # Errors
/// [`PlantError`] for drives that cannot be built.
///
/// ```
/// let dbc = masseter_commissioning::description::dbc(&masseter_scenario::Scenario::default())?;
/// assert!(dbc.contains("BO_ 385 d1_TPDO1: 8 d1"));
/// # Ok::<_, masseter_plant::PlantError>(())
/// ```
pub fn dbc(scenario: &Scenario) -> Result<String, PlantError> {
    let with_objects = |settings: DriveSettings| Ok((settings.objects()?, settings));
    let drives =
        drive_settings(scenario)?.into_iter().map(with_objects).collect::<Result<Vec<_>, PlantError>>()?;
    Ok(write_dbc(&drives, scenario.period_ns()))
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
fn write_dbc(drives: &[(Objects, DriveSettings)], period_ns: u64) -> String {
    let to_all = [MASTER, ANYBODY];
    let mut parts = vec![
        format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {MASTER} {}\n\n", AXIS_NAMES.join(" ")),
        message(Cob::Nmt.into(), "NMT", to_all, &numbers([("Command", 8), ("Node", 8)])),
        message(Cob::Sync.into(), "SYNC", to_all, &[]),
        message(Cob::Heartbeat(MASTER_NODE).into(), "Master_heartbeat", to_all, &numbers([("State", 8)])),
    ];
    for ((objects, settings), name) in drives.iter().zip(AXIS_NAMES) {
        parts.extend(services(settings.node, name));
        parts.extend(process_data(objects, &settings.ratings, name));
    }
    parts.push(cycle_times(drives, period_ns));
    parts.push(values(Cob::Nmt, "Command", &NmtCommand::ALL.map(|command| (command.code(), command.name()))));
    let states = NmtState::ALL.map(|state| (state.code(), state.name()));
    let nodes = [MASTER_NODE].into_iter().chain(drives.iter().map(|(_, settings)| settings.node));
    parts.extend(nodes.map(|node| values(Cob::Heartbeat(node), "State", &states)));
    parts.concat()
}

/// The messages of a node in the predefined connection set.
fn services(node: NodeId, name: &str) -> [String; 4] {
    let (to_master, from_master) = ([name, MASTER], [MASTER, name]);
    let emergency = numbers([("Error_code", 16), ("Error_register", 8), ("Vendor", 40)]);
    let sdo = numbers([("Command", 8), ("Index", 16), ("Subindex", 8), ("Data", 32)]);
    let heartbeat = numbers([("State", 8)]);
    [
        message(Cob::Emergency(node).into(), &format!("{name}_EMCY"), to_master, &emergency),
        message(Cob::SdoResponse(node).into(), &format!("{name}_SDO_response"), to_master, &sdo),
        message(Cob::SdoRequest(node).into(), &format!("{name}_SDO_request"), from_master, &sdo),
        message(Cob::Heartbeat(node).into(), &format!("{name}_heartbeat"), to_master, &heartbeat),
    ]
}

/// The PDOs that exist after power-on.
fn process_data(objects: &Objects, drive: &Ratings, name: &str) -> Vec<String> {
    let mut messages = Vec::new();
    for number in 0..PDOS as u16 {
        let rpdo = ("RPDO", 0x1400, [MASTER, name]);
        for (direction, communication, nodes) in [rpdo, ("TPDO", 0x1800, [name, MASTER])] {
            let cob_id = CobId(objects.at(communication + number, 1));
            let Some(id) = cob_id.identifier() else { continue };
            let signals = mapped(objects, communication + 0x0200 + number, drive);
            messages.push(message(id, &format!("{name}_{direction}{}", number + 1), nodes, &signals));
        }
    }
    messages
}

fn mapped(objects: &Objects, index: u16, drive: &Ratings) -> Vec<Signal> {
    let signal = |entry: &Entry| {
        let (factor, unit, limits) = match entry.address.index {
            0x6064 | 0x607A => {
                let end = |subindex| f64::from(objects.at(0x607D, subindex) as i32);
                (drive.encoder_resolution_m, "m", Some([end(1), end(2)]))
            }
            0x6077 | 0x60B2 => {
                let most = f64::from(objects.at(0x6072, 0));
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
fn cycle_times(drives: &[(Objects, DriveSettings)], period_ns: u64) -> String {
    let heartbeat_ms = |objects: &Objects| u64::from(objects.at(0x1017, 0));
    let mut times = vec![(CanId::from(Cob::Sync), period_ns / MILLISECOND_NS)];
    times.push((Cob::Heartbeat(MASTER_NODE).into(), heartbeat_ms(&drives[0].0)));
    for (objects, settings) in drives {
        times.push((Cob::Heartbeat(settings.node).into(), heartbeat_ms(objects)));
        let communications = (0..PDOS as u16).flat_map(|number| [0x1400 + number, 0x1800 + number]);
        times.extend(communications.filter_map(|communication| {
            let id = CobId(objects.at(communication, 1)).identifier()?;
            let every = u64::from(objects.at(communication, 2));
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
    let lists = object_lists(objects.keys().copied());
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
    use super::*;

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
