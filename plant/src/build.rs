//! Builds master, wires, drives and mechanism from a scenario, and refuses what cannot work.

use masseter_can::PortFaults;
use masseter_can::canopen::{NodeId, sync};
use masseter_can::faults::Faults;
use masseter_can::wire::{INTERFRAME_BITS, frame_bits};
use masseter_can::{VirtualWire, WireConfig};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{CanConfig, Scenario};
use masseter_shared::geometry::{AXES, Mechanism};

use crate::checks::check_quantities;
use crate::drive::{DriveNode, DriveSettings};
use crate::emulation::Emulation;
use crate::encoder::Encoder;
use crate::error::PlantError;
use crate::expectation::setup;
use crate::faults;
use crate::food::Food;
use crate::layout::{node_ids, places};
use crate::link::{MASTER_PORT, VirtualLink};
use crate::master::{DriveSettings as ExpectedDrive, Master, MasterSettings, Scale};
use crate::resting::{closed_mouth, resting};
use crate::socket_link::SocketLink;

/// Frames a port may have to send, and to receive between two looks; a millisecond holds 21.
const TRANSMIT_CAPACITY: usize = 64;
const RECEIVE_CAPACITY: usize = 256;

/// The master of a scenario's plant.
pub(crate) fn build_master(scenario: &Scenario, now_ns: u64) -> Result<Master, PlantError> {
    let places = places(&scenario.can)?;
    let ids = node_ids(&scenario.can)?;
    let drives = std::array::from_fn(|axis| {
        let drive = scenario.drives.of_axis(axis);
        let scale = Scale { increment_m: drive.encoder_resolution_m, rated_force_n: drive.rated_force_n };
        ExpectedDrive { id: ids[axis], bus: places[axis].bus, scale, setup: setup(scenario, axis) }
    });
    Ok(Master::new(master_settings(&scenario.can, drives)?, now_ns))
}

/// The emulated drives on simulated wires, switched on at `now_ns`, with so many free ports on each wire.
pub(crate) fn build_virtual(
    scenario: &Scenario,
    free_ports: usize,
    now_ns: u64,
) -> Result<VirtualLink, PlantError> {
    let emulation = build_emulation(scenario, now_ns)?;
    let places = places(&scenario.can)?;
    Ok(VirtualLink::new(wires(scenario, free_ports, now_ns)?, places, emulation))
}

/// The real interfaces, with the faults of the master's ports.
pub(crate) fn build_sockets(scenario: &Scenario, now_ns: u64) -> Result<SocketLink, PlantError> {
    check_quantities(scenario)?;
    let can = &scenario.can;
    let port_faults = |bus: usize| {
        let faults = faults::of_bus(&scenario.faults, bus, &[NodeId::MASTER], now_ns)?;
        let faults = PortFaults::new(faults, MASTER_PORT, fault_seed(scenario, bus))?;
        Ok(faults.restarting_after(restart_after_ns(can)))
    };
    let faults = (0..can.buses.len()).map(port_faults).collect::<Result<_, PlantError>>()?;
    SocketLink::open(&can.interfaces, can.format(), faults)
}

/// Each bus makes choices of its own.
fn fault_seed(scenario: &Scenario, bus: usize) -> u64 {
    scenario.seed.wrapping_add(bus as u64)
}

/// Time after which a controller that went off the bus is restarted; none when it is not.
fn restart_after_ns(can: &CanConfig) -> Option<u64> {
    (can.restart_ms > 0).then(|| u64::from(can.restart_ms) * MILLISECOND_NS)
}

/// The drives and their mechanism, switched on at `now_ns`.
pub(crate) fn build_emulation(scenario: &Scenario, now_ns: u64) -> Result<Emulation, PlantError> {
    check_quantities(scenario)?;
    let ids = node_ids(&scenario.can)?;
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let food = scenario.food.map(|config| Food::new(config, &closed_mouth(&mechanism, &scenario.jaw)));
    let dynamics = resting(mechanism, &scenario.dynamics)?.chewing(food);
    let positions_m = dynamics.state().positions_m();
    let drives = (0..AXES)
        .map(|axis| {
            let drive = scenario.drives.of_axis(axis);
            let encoder =
                Encoder::new(drive.encoder_resolution_m, drive.encoder_noise_m, scenario.seed, axis);
            DriveNode::new(&drive_settings(scenario, ids[axis], axis), encoder, now_ns, positions_m[axis])
        })
        .collect();
    Ok(Emulation::new(drives, dynamics, scenario.dynamics.step_ns, now_ns))
}

fn master_settings(can: &CanConfig, drives: [ExpectedDrive; AXES]) -> Result<MasterSettings, PlantError> {
    let rates = can.rates()?;
    let sync_bits = frame_bits(&sync::frame().promoted(can.format()));
    Ok(MasterSettings {
        id: NodeId::MASTER,
        drives,
        buses: can.buses.len(),
        sync_ns: rates.duration_ns(sync_bits) - rates.nominal().bits_to_ns(INTERFRAME_BITS),
        heartbeat_ns: u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS,
        heartbeat_timeout_ns: u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS,
        boot_timeout_ns: u64::from(can.boot_timeout_ms) * MILLISECOND_NS,
        command_timeout_cycles: can.command_timeout_cycles,
    })
}

/// What the drives of a scenario that can be are configured with, in the order of the axes.
pub(crate) fn all_drive_settings(scenario: &Scenario) -> Result<[DriveSettings; AXES], PlantError> {
    check_quantities(scenario)?;
    let ids = node_ids(&scenario.can)?;
    Ok(std::array::from_fn(|axis| drive_settings(scenario, ids[axis], axis)))
}

fn drive_settings(scenario: &Scenario, node: NodeId, axis: usize) -> DriveSettings {
    let (drive, stroke_m) = (scenario.drives.of_axis(axis), scenario.mechanism.strokes.of_axis(axis));
    DriveSettings {
        node,
        master: NodeId::MASTER,
        drive,
        heartbeat_ns: u64::from(scenario.can.heartbeat_producer_ms) * MILLISECOND_NS,
        link_timeout_ns: u64::from(scenario.can.heartbeat_consumer_ms) * MILLISECOND_NS,
        period_ns: scenario.period_ns(),
        step_s: scenario.dynamics.step_ns as f64 * 1e-9,
        position_limit_increments: stroke_m.map(|end_m| drive.increments(end_m) as i32),
    }
}

fn wires(scenario: &Scenario, free_ports: usize, now_ns: u64) -> Result<Vec<VirtualWire>, PlantError> {
    let can = &scenario.can;
    let (rates, ids) = (can.rates()?, node_ids(can)?);
    let wire = |(bus, axes): (usize, &Vec<usize>)| {
        let nodes: Vec<_> =
            std::iter::once(NodeId::MASTER).chain(axes.iter().map(|&axis| ids[axis])).collect();
        let config = WireConfig {
            rates,
            format: can.format(),
            ports: nodes.len() + free_ports,
            transmit_capacity: TRANSMIT_CAPACITY,
            receive_capacity: RECEIVE_CAPACITY,
            restart_after_ns: restart_after_ns(can),
        };
        let faults = faults::of_bus(&scenario.faults, bus, &nodes, now_ns)?;
        Ok(VirtualWire::with_faults(&config, Faults::new(faults, fault_seed(scenario, bus))))
    };
    can.buses.iter().enumerate().map(wire).collect()
}
