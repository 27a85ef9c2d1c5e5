//! Every kind of fault, at every node and message, for several durations, at several instants of the motion: what it
//! does to the jaw and what detects it, as a table. None may lead the jaw beyond the limits. The command `masseter
//! faults matrix` takes a sample of these; the whole table takes minutes:
//!
//!     cargo test --release --package masseter --test rig -- --ignored fault_table
//!
//! The tables stay in the folder FAULT_TABLES, else in that for temporary files.
//!
//! SDO, NMT and boot-up messages are sent while the drives boot, and have a table of their own. The tables lack
//! delays other than 1.5 ms, faults that act on a part of the frames, and two faults at a time. The motion is the
//! default one, at 1 kHz, without food.

use std::fmt::Display;
use std::fs;
use std::path::PathBuf;

use masseter_controller::motion_controller::MotionController;
use masseter_judge::{Analysis, Figures, Verdict};
use masseter_plan::RunPlan;
use masseter_recording::Manifest;
use masseter_scenario::{BusFault, ChecksConfig, FaultConfig, Scenario};
use masseter_virtual_time::Uninterrupted;
use rayon::prelude::*;

const CYCLES: [u32; 8] = [1, 2, 5, 10, 20, 50, 100, 500];
/// Since switch-on: while easing, while chewing, and where the legs move fastest.
const FROM_S: [f64; 4] = [0.7, 2.5, 3.0, 3.25];
/// Every message is sent within so many cycles.
const SENT_WITHIN: u32 = 100;
/// While the drives boot.
const BOOT_FROM_S: [f64; 2] = [0.0, 0.05];
const BOOT_S: f64 = 0.5;
const NEVER_STRUCK: &str = "never struck";
const MASTER: u8 = 127;
const SYNC: u16 = 0x080;
const TPDO1: u16 = 0x180;
const RPDO1: u16 = 0x200;
const HEARTBEAT: u16 = 0x700;
const NMT: u16 = 0x000;
const EMERGENCY: u16 = 0x080;
const SDO_ANSWER: u16 = 0x580;
const SDO_REQUEST: u16 = 0x600;

/// The messages of a bus in each cycle, with their senders and receivers.
fn messages(nodes: &[u8]) -> Vec<(u8, u8, u16)> {
    let of_node = |&node: &u8| {
        let id = u16::from(node);
        [
            (MASTER, node, SYNC),
            (MASTER, node, RPDO1 + id),
            (MASTER, node, HEARTBEAT + u16::from(MASTER)),
            (node, MASTER, TPDO1 + id),
            (node, MASTER, HEARTBEAT + id),
        ]
    };
    nodes.iter().flat_map(of_node).collect()
}

/// The messages of a bus while its drives boot, with their senders and receivers.
fn boot_messages(nodes: &[u8]) -> Vec<(u8, u8, u16)> {
    let of_node = |&node: &u8| {
        let id = u16::from(node);
        [
            (MASTER, node, NMT),
            (MASTER, node, SDO_REQUEST + id),
            (node, MASTER, SDO_ANSWER + id),
            (node, MASTER, EMERGENCY + id),
            (node, MASTER, HEARTBEAT + id),
        ]
    };
    nodes.iter().flat_map(of_node).collect()
}

fn fault(kind: BusFault, bus: usize, node: u8, id: Option<u16>) -> FaultConfig {
    let size = (kind == BusFault::Delay).then(|| "1500 us".parse().expect("a time"));
    FaultConfig { bus: Some(bus), node: Some(node), id, size, ..FaultConfig::new(kind) }
}

/// Every fault of a bus, without its time.
fn faults_of_bus(bus: usize, nodes: &[u8]) -> Vec<FaultConfig> {
    use BusFault::{Babble, BusOff, Disconnect};
    let gone = nodes
        .iter()
        .chain([&MASTER])
        .flat_map(|&node| [Babble, Disconnect, BusOff].map(|kind| fault(kind, bus, node, None)));
    faults_of_messages(bus, &messages(nodes)).into_iter().chain(gone).collect()
}

fn faults_of_messages(bus: usize, messages: &[(u8, u8, u16)]) -> Vec<FaultConfig> {
    use BusFault::{Corrupt, Delay, Duplicate, Lose};
    let lost = messages.iter().map(|&(_, receiver, id)| fault(Lose, bus, receiver, Some(id)));
    let mut sent: Vec<_> = messages.iter().map(|&(sender, _, id)| (sender, id)).collect();
    sent.sort_unstable();
    sent.dedup();
    let sent = sent
        .iter()
        .flat_map(|&(sender, id)| [Corrupt, Delay, Duplicate].map(|kind| fault(kind, bus, sender, Some(id))));
    lost.chain(sent).collect()
}

fn or_none(value: Option<impl Display>) -> String {
    value.map_or_else(String::new, |value| value.to_string())
}

/// Plays a scenario by the rig's own controller, and judges it.
fn play(scenario: Scenario) -> (Verdict, Figures) {
    let plan = RunPlan::new(scenario).expect("every fault can be planned");
    let motion_s = plan.trajectory.duration_s();
    let machine = masseter_machine::describe();
    let mut manifest = Manifest::new("test", plan.scenario.clone(), motion_s, "virtual", machine);
    let figures = masseter_virtual_time::analyse(
        &plan,
        |scenario, mechanism, motion| Box::new(MotionController::new(scenario, mechanism, motion)),
        Analysis::without_report,
        &mut manifest,
        &Uninterrupted,
    )
    .expect("every fault can be played");
    (Verdict::new(&manifest, &figures), figures)
}

/// A row, and whether it is wrong. It is wrong if the fault never struck although its message was due, or led the jaw
/// beyond the limits. So is a row that ends otherwise than with a pass or a safe stop.
fn row(fault: &FaultConfig, cycles: u32, from_s: f64) -> (String, bool) {
    let until_s = Some(from_s + f64::from(cycles) * 1e-3);
    let faults = vec![FaultConfig { from_s: Some(from_s), until_s, ..fault.clone() }];
    let scenario = Scenario { duration_s: Some(4.0), faults, ..Scenario::default() };
    let (Verdict { word, .. }, figures) = play(scenario);
    let found = &figures.faults[0];
    let (mm, deg) = (found.deviation_mm, found.deviation_deg);
    let verdict = if found.struck_ns.is_none() { NEVER_STRUCK } else { word };
    let detection = found.detection.as_ref();
    let row = format!(
        "{},{},{},{},{cycles},{from_s},{mm:.4},{deg:.4},{},{},{verdict}\n",
        fault.kind,
        or_none(fault.bus),
        or_none(fault.node),
        or_none(fault.id.map(|id| format!("{id:03X}h"))),
        or_none(detection.map(|detection| detection.cause)),
        or_none(detection.map(|detection| detection.latency_ms)),
    );
    let ChecksConfig { tracking_max_mm, tracking_max_deg, .. } = ChecksConfig::default();
    // Heartbeats are rarer than the shorter faults, and the messages of the boot are sent once.
    let is_rare = from_s < BOOT_S || (fault.id.is_some_and(|id| id >= HEARTBEAT) && cycles < SENT_WITHIN);
    let is_typed = ["PASS", "SAFE STOP"].contains(&verdict) || (is_rare && verdict == NEVER_STRUCK);
    // The negation also counts NaN.
    let is_within = mm <= tracking_max_mm && deg <= tracking_max_deg;
    (row, !is_typed || !is_within)
}

#[test]
#[ignore = "takes minutes: a shard of scripts/nightly"]
fn no_fault_leads_the_jaw_beyond_the_limits() {
    judge_table("fault-table.csv", faults_of_bus, &CYCLES, &FROM_S);
}

#[test]
#[ignore = "takes minutes: a shard of scripts/nightly"]
fn no_fault_of_the_boot_leads_the_jaw_beyond_the_limits() {
    let of_boot = |bus, nodes: &[u8]| faults_of_messages(bus, &boot_messages(nodes));
    judge_table("fault-table-boot.csv", of_boot, &CYCLES, &BOOT_FROM_S);
}

/// Plays every fault for every duration at every instant, and leaves the table in the file.
fn judge_table(
    file: &str,
    faults_of: impl Fn(usize, &[u8]) -> Vec<FaultConfig>,
    cycles: &[u32],
    from_s: &[f64],
) {
    let can = Scenario::default().can;
    let of_bus = |(bus, axes): (usize, &Vec<usize>)| {
        let nodes: Vec<_> = axes.iter().map(|&axis| can.node_ids[axis]).collect();
        faults_of(bus, &nodes)
    };
    let faults: Vec<_> = can.buses.iter().enumerate().flat_map(of_bus).collect();
    let cases: Vec<_> = faults
        .iter()
        .flat_map(|fault| {
            cycles.iter().flat_map(move |&cycles| from_s.iter().map(move |&from_s| (fault, cycles, from_s)))
        })
        .collect();
    let rows: Vec<_> =
        cases.into_par_iter().map(|(fault, cycles, from_s)| row(fault, cycles, from_s)).collect();
    let header = "kind,bus,node,id,cycles,from_s,deviation_mm,deviation_deg,detected_by,latency_ms,verdict\n";
    let table = rows.iter().map(|(row, _)| row.as_str()).collect::<String>();
    let folder = std::env::var_os("FAULT_TABLES").map_or_else(std::env::temp_dir, PathBuf::from);
    let path = folder.join(file);
    fs::write(&path, header.to_owned() + &table).expect("the table is written");
    assert!(rows.iter().any(|(row, _)| !row.contains(NEVER_STRUCK)), "no fault struck");
    let wrong: String = rows.iter().filter(|(_, is_wrong)| *is_wrong).map(|(row, _)| row.as_str()).collect();
    assert!(
        wrong.is_empty(),
        "beyond the limits or never struck, of the rows in {}:\n{header}{wrong}",
        path.display()
    );
}
