//! What the CAN link costs a cycle, beside all that the plant does in one: `cargo bench -p masseter-plant`.
//!
//! CPU time of a cycle in virtual time: six drives and the master on two classical buses at 1 Mbit/s.

use divan::{Bencher, black_box};
use masseter_can::canopen::{NodeId, sync};
use masseter_can::cia402::{Controlword, Statusword};
use masseter_can::{Bitrate, Bus, PdoMapping, Rpdo1, Tpdo1, VirtualWire, WireConfig};
use masseter_plant::core::PlantCore;
use masseter_runtime::messages::codes::DriveRequest;
use masseter_runtime::messages::{Command, LAYOUT_VERSION, Reading};
use masseter_runtime::realtime::Wake;
use masseter_scenario::{FoodConfig, FrictionModel, LoadCellConfig, Scenario, TeethConfig};

const PERIOD_NS: u64 = 1_000_000;
const BUSES: u8 = 2;
const DRIVES: u8 = 3;
/// Cycles until the drives are booted and enabled.
const BOOT_CYCLES: u64 = 1000;

fn main() {
    divan::main();
}

fn node(number: u8) -> NodeId {
    NodeId::new(number).expect("a node id")
}

/// Cycles from 0 on, one a call.
fn each_cycle(bencher: Bencher<'_, '_>, mut run: impl FnMut(u64)) {
    let mut cycle = 0;
    bencher.bench_local(|| {
        run(cycle);
        cycle += 1;
    });
}

fn wire() -> VirtualWire {
    VirtualWire::new(&WireConfig {
        bitrate: Bitrate::MAX,
        ports: 1 + usize::from(DRIVES),
        transmit_capacity: 64,
        receive_capacity: 256,
        restart_after_ns: None,
    })
}

/// Lets all frames arrive, and fetches them at every port and at the tap.
fn settle(wire: &mut VirtualWire) {
    while let Some(event_ns) = wire.next_event_ns() {
        wire.advance(event_ns);
        for port in 0..=usize::from(DRIVES) {
            while let Ok(Some(received)) = wire.port(port).receive(event_ns) {
                black_box(received);
            }
        }
    }
    while let Ok(Some(tapped)) = wire.tap(u64::MAX) {
        black_box(tapped);
    }
}

fn rpdo1(target_increments: i32) -> Rpdo1 {
    Rpdo1 { controlword: Controlword(0x1F), target_increments, torque_offset_permille: 0 }
}

/// SYNC, three TPDOs and three RPDOs on one wire.
fn exchange(wire: &mut VirtualWire, bus: u8, cycle: u64) {
    let sync_ns = cycle * PERIOD_NS;
    let position = (cycle as i32).wrapping_mul(97);
    wire.port(0).send(sync_ns, sync::frame()).expect("room");
    settle(wire);
    let drives = (1..=DRIVES).map(|drive| (usize::from(drive), node(bus * DRIVES + drive)));
    for (port, id) in drives.clone() {
        let tpdo =
            Tpdo1 { statusword: Statusword(0x1237), actual_increments: position, torque_permille: 120 };
        wire.port(port).send(sync_ns + 60_000, tpdo.frame(id, &PdoMapping::TPDO1)).expect("room");
    }
    settle(wire);
    for (_, id) in drives {
        let rpdo = rpdo1(position);
        wire.port(0).send(sync_ns + 545_000, rpdo.frame(id, &PdoMapping::RPDO1)).expect("room");
    }
    settle(wire);
}

/// The wires alone, with the frames of a cycle.
#[divan::bench]
fn wires(bencher: Bencher<'_, '_>) {
    let mut wires: Vec<_> = (0..BUSES).map(|_| wire()).collect();
    each_cycle(bencher, |cycle| {
        for (wire, bus) in wires.iter_mut().zip(0..) {
            exchange(wire, bus, cycle);
        }
    });
}

/// Master, wires, drives and mechanism, booted and enabled.
#[divan::bench]
fn plant(bencher: Bencher<'_, '_>) {
    plant_of(bencher, &Scenario::default());
}

/// The plant with bristles, teeth, food and a load cell.
#[divan::bench]
fn plant_with_everything(bencher: Bencher<'_, '_>) {
    let mut scenario = Scenario {
        teeth: Some(TeethConfig::default()),
        food: Some(FoodConfig::default()),
        load_cell: Some(LoadCellConfig::default()),
        ..Scenario::default()
    };
    scenario.dynamics.friction.model = FrictionModel::Lugre;
    plant_of(bencher, &scenario);
}

fn plant_of(bencher: Bencher<'_, '_>, scenario: &Scenario) {
    let mut plant = PlantCore::new(scenario, 0).expect("the scenario is a plant");
    let mut reading = Reading::default();
    let mut run = |cycle: u64| {
        let sync_ns = cycle * PERIOD_NS;
        let wake = Wake::on_time(cycle, sync_ns);
        plant.begin_cycle(wake).expect("dynamics");
        plant.collect(sync_ns + 525_000).expect("dynamics");
        plant.fill_reading(&mut reading);
        let request = DriveRequest::Enable.code();
        let command = Command {
            cycle,
            target_m: reading.position_m,
            request,
            version: LAYOUT_VERSION,
            ..Command::default()
        };
        plant.apply(sync_ns + 545_000, Some(&command)).expect("dynamics");
        for frame in plant.drain_frames() {
            black_box(frame);
        }
        plant.drain_events(&mut |event| {
            black_box(event);
        });
    };
    (1..=BOOT_CYCLES).for_each(&mut run);
    each_cycle(bencher, |cycle| run(BOOT_CYCLES + 1 + cycle));
}

#[divan::bench]
fn rpdo1_encode(bencher: Bencher<'_, '_>) {
    let rpdo = rpdo1(123_456);
    bencher.bench(|| black_box(rpdo).frame(black_box(node(3)), &PdoMapping::RPDO1));
}

#[divan::bench]
fn rpdo1_decode(bencher: Bencher<'_, '_>) {
    let frame = rpdo1(123_456).frame(node(3), &PdoMapping::RPDO1);
    bencher.bench(|| Rpdo1::decode(black_box(&frame).data(), &PdoMapping::RPDO1));
}

#[divan::bench]
fn tpdo1_encode(bencher: Bencher<'_, '_>) {
    let tpdo = Tpdo1 { statusword: Statusword(0x1237), actual_increments: 123_456, torque_permille: 120 };
    bencher.bench(|| black_box(tpdo).frame(black_box(node(3)), &PdoMapping::TPDO1));
}

#[divan::bench]
fn tpdo1_decode(bencher: Bencher<'_, '_>) {
    let tpdo = Tpdo1 { statusword: Statusword(0x1237), actual_increments: 123_456, torque_permille: 120 };
    let frame = tpdo.frame(node(3), &PdoMapping::TPDO1);
    bencher.bench(|| Tpdo1::decode(black_box(&frame).data(), &PdoMapping::TPDO1));
}
