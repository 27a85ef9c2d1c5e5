//! The messages of the link as a DBC file: SYNC, NMT, and of every drive its PDOs as mapped after power-on,
//! EMCY, SDO and heartbeat. Positions are in metres, forces in newtons.
//!
//! Both directions of SDO have their four parts as signals; segments are not decoded.

use std::fmt::{self, Write};

use masseter_can::canopen::{Cob, NmtCommand, NmtState, NodeId};
use masseter_can::{CanId, Frame};
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

/// A signal of a message, little endian.
struct Signal<'a> {
    name: String,
    start_bit: usize,
    bits: usize,
    is_signed: bool,
    factor: f64,
    unit: &'a str,
}

impl Signal<'_> {
    /// A number without a unit.
    fn plain(name: &str, start_bit: usize, bits: usize) -> Self {
        Self { name: name.to_owned(), start_bit, bits, is_signed: false, factor: 1.0, unit: "" }
    }

    fn write(&self, text: &mut String, receiver: &str) -> fmt::Result {
        let Self { name, start_bit, bits, is_signed, factor, unit } = self;
        let sign = if *is_signed { '-' } else { '+' };
        writeln!(text, r#" SG_ {name} : {start_bit}|{bits}@1{sign} ({factor},0) [0|0] "{unit}" {receiver}"#)
    }
}

/// The file, lines ended by a line feed.
pub(super) fn write(drives: &[DriveSettings; AXES]) -> String {
    let mut text = String::new();
    messages(&mut text, drives)
        .and_then(|()| value_names(&mut text, drives))
        .expect("a string takes any text");
    text
}

fn messages(text: &mut String, drives: &[DriveSettings; AXES]) -> fmt::Result {
    writeln!(text, "VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_: {MASTER} {}\n", AXIS_NAMES.join(" "))?;
    let nmt = [Signal::plain("Command", 0, 8), Signal::plain("Node", 8, 8)];
    message(text, Cob::Nmt.into(), "NMT", 2, MASTER, &nmt, ANYBODY)?;
    message(text, Cob::Sync.into(), "SYNC", 0, MASTER, &[], ANYBODY)?;
    let state = [Signal::plain("State", 0, 8)];
    let master = drives[0].master;
    message(text, Cob::Heartbeat(master).into(), "Master_heartbeat", 1, MASTER, &state, ANYBODY)?;
    for (settings, name) in drives.iter().zip(AXIS_NAMES) {
        services(text, settings.node, name)?;
        process_data(text, settings, name)?;
    }
    Ok(())
}

/// The messages of a node in the predefined connection set.
fn services(text: &mut String, node: NodeId, name: &str) -> fmt::Result {
    let emergency = [
        Signal::plain("Error_code", 0, 16),
        Signal::plain("Error_register", 16, 8),
        Signal::plain("Vendor", 24, 40),
    ];
    let state = [Signal::plain("State", 0, 8)];
    let sdo = || {
        [
            Signal::plain("Command", 0, 8),
            Signal::plain("Index", 8, 16),
            Signal::plain("Subindex", 24, 8),
            Signal::plain("Data", 32, 32),
        ]
    };
    message(text, Cob::Emergency(node).into(), &format!("{name}_EMCY"), 8, name, &emergency, MASTER)?;
    message(text, Cob::SdoResponse(node).into(), &format!("{name}_SDO_response"), 8, name, &sdo(), MASTER)?;
    message(text, Cob::SdoRequest(node).into(), &format!("{name}_SDO_request"), 8, MASTER, &sdo(), name)?;
    message(text, Cob::Heartbeat(node).into(), &format!("{name}_heartbeat"), 1, name, &state, MASTER)
}

/// The PDOs that exist after power-on.
fn process_data(text: &mut String, settings: &DriveSettings, name: &str) -> fmt::Result {
    let objects = settings.objects();
    for number in 0..PDOS as u16 {
        for (direction, communication, mapping) in [("RPDO", 0x1400, 0x1600), ("TPDO", 0x1800, 0x1A00)] {
            let Some(id) = objects.cob_id(communication + number, 1).identifier() else { continue };
            let signals = mapped(&objects, mapping + number, &settings.drive);
            let length = signals.iter().map(|signal| signal.bits).sum::<usize>() / 8;
            let (sender, receiver) = if direction == "RPDO" { (MASTER, name) } else { (name, MASTER) };
            let title = format!("{name}_{direction}{}", number + 1);
            message(text, id, &title, length, sender, &signals, receiver)?;
        }
    }
    Ok(())
}

fn mapped<'a>(objects: &Objects, index: u16, drive: &DriveConfig) -> Vec<Signal<'a>> {
    let entries = (1..=objects.at(index, 0) as u8).map(|place| MappingEntry(objects.at(index, place)));
    let mut start_bit = 0;
    let signals = entries.map(|mapping| {
        let entry = &ENTRIES[find(mapping.object()).expect("only existing objects are mapped")].entry;
        let (factor, unit) = scale(mapping.object().index, drive);
        let name = entry.name.replace(' ', "_");
        let (bits, is_signed) = (mapping.bits(), entry.kind.is_signed());
        let signal = Signal { name, start_bit, bits, is_signed, factor, unit };
        start_bit += bits;
        signal
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

fn message(
    text: &mut String,
    id: CanId,
    name: &str,
    length: usize,
    sender: &str,
    signals: &[Signal<'_>],
    receiver: &str,
) -> fmt::Result {
    debug_assert!(length <= Frame::MAX_CLASSICAL_DATA, "a classical frame");
    writeln!(text, "BO_ {} {name}: {length} {sender}", id.number())?;
    signals.iter().try_for_each(|signal| signal.write(text, receiver))?;
    writeln!(text)
}

/// Names of the numbers of states and commands.
fn value_names(text: &mut String, drives: &[DriveSettings; AXES]) -> fmt::Result {
    let nmt = CanId::from(Cob::Nmt).number();
    let commands = NMT_COMMANDS.map(|(command, name)| (command.code(), name));
    values(text, nmt, "Command", &commands)?;
    let states = NMT_STATES.map(|(state, name)| (state.code(), name));
    let nodes = drives.iter().map(|settings| settings.node);
    for node in [drives[0].master].into_iter().chain(nodes) {
        values(text, CanId::from(Cob::Heartbeat(node)).number(), "State", &states)?;
    }
    Ok(())
}

fn values(text: &mut String, id: u32, signal: &str, names: &[(u8, &str)]) -> fmt::Result {
    write!(text, "VAL_ {id} {signal}")?;
    names.iter().try_for_each(|(value, name)| write!(text, " {value} \"{name}\""))?;
    writeln!(text, " ;")
}
