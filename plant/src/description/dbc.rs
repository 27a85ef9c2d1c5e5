//! The messages of the link as a DBC file: SYNC, NMT, and of every drive its PDOs as mapped after power-on,
//! EMCY, SDO and heartbeat. Positions are in metres, forces in newtons.
//!
//! Both directions of SDO have their four parts as signals; segments are not decoded.

use masseter_can::CanId;
use masseter_can::canopen::{Cob, NmtCommand, NmtState, NodeId};
use masseter_shared::config::DriveConfig;
use masseter_shared::geometry::{AXES, AXIS_NAMES};

use crate::drive::DriveSettings;
use crate::drive::dictionary::{ENTRIES, MappingEntry, Objects, PDOS, find};

const MASTER: &str = "Master";
/// Receiver of messages to all nodes.
const ANYBODY: &str = "Vector__XXX";

const NMT_STATES: [(NmtState, &str); 4] = [
    (NmtState::BootUp, "Boot-up"),
    (NmtState::Stopped, "Stopped"),
    (NmtState::Operational, "Operational"),
    (NmtState::PreOperational, "Pre-operational"),
];

const NMT_COMMANDS: [(NmtCommand, &str); 5] = [
    (NmtCommand::Start, "Start"),
    (NmtCommand::Stop, "Stop"),
    (NmtCommand::EnterPreOperational, "Enter pre-operational"),
    (NmtCommand::ResetNode, "Reset node"),
    (NmtCommand::ResetCommunication, "Reset communication"),
];

/// A signal of a message, little endian, that begins where the signal before ends.
struct Signal<'a> {
    name: String,
    bits: usize,
    is_signed: bool,
    factor: f64,
    unit: &'a str,
}

/// Numbers without a unit.
fn numbers(signals: &[(&str, usize)]) -> Vec<Signal<'static>> {
    let number = |&(name, bits): &(&str, usize)| {
        let name = name.to_owned();
        Signal { name, bits, is_signed: false, factor: 1.0, unit: "" }
    };
    signals.iter().map(number).collect()
}

/// The file, lines ended by a line feed.
pub(super) fn write(drives: &[DriveSettings; AXES]) -> String {
    let head = format!("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {MASTER} {}\n\n", AXIS_NAMES.join(" "));
    let state = numbers(&[("State", 8)]);
    let mut parts = vec![
        head,
        message(Cob::Nmt.into(), "NMT", [MASTER, ANYBODY], &numbers(&[("Command", 8), ("Node", 8)])),
        message(Cob::Sync.into(), "SYNC", [MASTER, ANYBODY], &[]),
        message(Cob::Heartbeat(NodeId::MASTER).into(), "Master_heartbeat", [MASTER, ANYBODY], &state),
    ];
    for (settings, name) in drives.iter().zip(AXIS_NAMES) {
        parts.extend(services(settings.node, name));
        parts.extend(process_data(settings, name));
    }
    parts.extend(value_names(drives));
    parts.concat()
}

/// The messages of a node in the predefined connection set.
fn services(node: NodeId, name: &str) -> [String; 4] {
    let (to_master, from_master) = ([name, MASTER], [MASTER, name]);
    let emergency = numbers(&[("Error_code", 16), ("Error_register", 8), ("Vendor", 40)]);
    let sdo = numbers(&[("Command", 8), ("Index", 16), ("Subindex", 8), ("Data", 32)]);
    let state = numbers(&[("State", 8)]);
    [
        message(Cob::Emergency(node).into(), &format!("{name}_EMCY"), to_master, &emergency),
        message(Cob::SdoResponse(node).into(), &format!("{name}_SDO_response"), to_master, &sdo),
        message(Cob::SdoRequest(node).into(), &format!("{name}_SDO_request"), from_master, &sdo),
        message(Cob::Heartbeat(node).into(), &format!("{name}_heartbeat"), to_master, &state),
    ]
}

/// The PDOs that exist after power-on.
fn process_data(settings: &DriveSettings, name: &str) -> Vec<String> {
    let objects = settings.objects();
    let mut messages = Vec::new();
    for number in 0..PDOS as u16 {
        let rpdo = ("RPDO", 0x1400, [MASTER, name]);
        for (direction, communication, nodes) in [rpdo, ("TPDO", 0x1800, [name, MASTER])] {
            let Some(id) = objects.cob_id(communication + number, 1).identifier() else { continue };
            let signals = mapped(&objects, communication + 0x0200 + number, &settings.drive);
            messages.push(message(id, &format!("{name}_{direction}{}", number + 1), nodes, &signals));
        }
    }
    messages
}

fn mapped<'a>(objects: &Objects, index: u16, drive: &DriveConfig) -> Vec<Signal<'a>> {
    let entries = (1..=objects.at(index, 0) as u8).map(|place| MappingEntry(objects.at(index, place)));
    let signals = entries.map(|mapping| {
        let entry = &ENTRIES[find(mapping.object()).expect("only existing objects are mapped")].entry;
        let (factor, unit) = scale(mapping.object().index, drive);
        let (name, is_signed) = (entry.name.replace(' ', "_"), entry.kind.is_signed());
        Signal { name, bits: mapping.bits(), is_signed, factor, unit }
    });
    signals.collect()
}

/// Scale and unit of an object that is mapped after power-on.
fn scale(index: u16, drive: &DriveConfig) -> (f64, &'static str) {
    match index {
        0x6064 | 0x607A => (drive.encoder_resolution_m, "m"),
        0x6077 => (drive.rated_force_n / 1000.0, "N"),
        _ => (1.0, ""),
    }
}

fn message(id: CanId, name: &str, [sender, receiver]: [&str; 2], signals: &[Signal<'_>]) -> String {
    let (mut lines, mut start) = (Vec::new(), 0);
    for Signal { name, bits, is_signed, factor, unit } in signals {
        let sign = if *is_signed { '-' } else { '+' };
        let place = format!("{start}|{bits}@1{sign}");
        lines.push(format!(" SG_ {name} : {place} ({factor},0) [0|0] \"{unit}\" {receiver}\n"));
        start += bits;
    }
    format!("BO_ {} {name}: {} {sender}\n{}\n", id.number(), start / 8, lines.concat())
}

/// Names of the numbers of states and commands.
fn value_names(drives: &[DriveSettings; AXES]) -> Vec<String> {
    let commands = NMT_COMMANDS.map(|(command, name)| (command.code(), name));
    let states = NMT_STATES.map(|(state, name)| (state.code(), name));
    let nodes = [NodeId::MASTER].into_iter().chain(drives.iter().map(|settings| settings.node));
    let states = nodes.map(|node| values(Cob::Heartbeat(node), "State", &states));
    [values(Cob::Nmt, "Command", &commands)].into_iter().chain(states).collect()
}

fn values(cob: Cob, signal: &str, names: &[(u8, &str)]) -> String {
    let names: Vec<_> = names.iter().map(|(value, name)| format!("{value} \"{name}\"")).collect();
    format!("VAL_ {} {signal} {} ;\n", CanId::from(cob).number(), names.join(" "))
}
