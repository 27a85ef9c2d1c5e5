//! The messages of the link as a DBC file: SYNC, NMT, and of every drive its PDOs as mapped after power-on,
//! EMCY, SDO and heartbeat. Positions are in metres, forces in newtons.
//!
//! Both directions of SDO have their four parts as signals; segments are not decoded.

use masseter_can::CanId;
use masseter_can::canopen::{Cob, CobId, NmtCommand, NmtState, NodeId};
use masseter_model::geometry::{AXES, AXIS_NAMES};
use masseter_runtime::clock::MILLISECOND_NS;
use masseter_scenario::{DriveConfig, MASTER_NODE};

use crate::drive::DriveSettings;
use crate::drive::dictionary::{ENTRIES, Objects, PDOS, names};

const MASTER: &str = "Master";
/// Receiver of messages to all nodes.
const ANYBODY: &str = "Vector__XXX";

/// A signal of a message, little endian, that begins where the signal before ends.
struct Signal {
    name: String,
    bits: usize,
    is_signed: bool,
    factor: f64,
    unit: &'static str,
    /// Lowest and highest value in that unit; none where every value can come.
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
pub(super) fn write(drives: &[DriveSettings; AXES], period_ns: u64) -> String {
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

fn mapped(objects: &Objects, index: u16, drive: &DriveConfig) -> Vec<Signal> {
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

/// How often each message that comes regularly does so, ms: heartbeats, and SYNC with the PDOs that follow it. Whole
/// milliseconds alone can be said, so that a faster SYNC has no such time.
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
