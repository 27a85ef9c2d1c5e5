//! Builds master, wires, drives and mechanism from a scenario, and refuses what cannot work.

use masseter_shared::can::canopen::{NodeId, sync};
use masseter_shared::can::faults::Faults;
use masseter_shared::can::wire::{INTERFRAME_BITS, frame_bits};
use masseter_shared::can::wrapped::PortFaults;
use masseter_shared::can::{VirtualWire, WireConfig};
use masseter_shared::clock::MILLISECOND_NS;
use masseter_shared::config::{CanConfig, DynamicsConfig, JawConfig, Scenario};
use masseter_shared::geometry::{AXES, LEGS, Mechanism, Pose};
use nalgebra::Translation3;

use crate::checks::check_quantities;
use crate::drive::{DriveNode, DriveSettings};
use crate::emulation::Emulation;
use crate::encoder::Encoder;
use crate::error::PlantError;
use crate::expectation::setup;
use crate::faults;
use crate::food::Food;
use crate::link::{MASTER_PORT, Place, VirtualLink};
use crate::master::{DriveSettings as ExpectedDrive, Master, MasterSettings, Scale};
use crate::mechanism::Dynamics;
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

/// The interface of each axis' bus.
pub(crate) fn interfaces_of_axes(can: &CanConfig) -> Result<[&str; AXES], PlantError> {
    Ok(places(can)?.map(|place| can.interfaces[place.bus].as_str()))
}

/// The drives and their mechanism, switched on at `now_ns`.
pub(crate) fn build_emulation(scenario: &Scenario, now_ns: u64) -> Result<Emulation, PlantError> {
    check_quantities(scenario)?;
    let ids = node_ids(&scenario.can)?;
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let food = scenario.food.map(|config| Food::new(config, &closed_mouth(&mechanism, &scenario.jaw)));
    let dynamics = resting(mechanism, &scenario.dynamics)?.chewing(food);
    let positions_m = dynamics.positions_m();
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

/// Where each axis hangs; port 0 of a bus is the master's.
fn places(can: &CanConfig) -> Result<[Place; AXES], PlantError> {
    let named = || can.buses.iter().flatten().copied();
    if let Some(axis) = named().find(|&axis| axis >= AXES) {
        return Err(PlantError::Axis { axis, times: named().filter(|&other| other == axis).count() });
    }
    if let Some(bus) = can.buses.iter().position(Vec::is_empty) {
        return Err(PlantError::EmptyBus { bus });
    }
    let mut places = [Place { bus: 0, port: 0 }; AXES];
    for (axis, place) in places.iter_mut().enumerate() {
        let times = named().filter(|&other| other == axis).count();
        if times != 1 {
            return Err(PlantError::Axis { axis, times });
        }
        for (bus, axes) in can.buses.iter().enumerate() {
            if let Some(index) = axes.iter().position(|&other| other == axis) {
                *place = Place { bus, port: index + 1 };
            }
        }
    }
    Ok(places)
}

fn node_ids(can: &CanConfig) -> Result<[NodeId; AXES], PlantError> {
    let mut ids = [NodeId::MASTER; AXES];
    for (axis, &id) in can.node_ids.iter().enumerate() {
        let is_taken = id == NodeId::MASTER.get() || can.node_ids[..axis].contains(&id);
        if is_taken {
            return Err(PlantError::SharedNodeId { id });
        }
        ids[axis] = NodeId::new(id)?;
    }
    Ok(ids)
}

/// The platform where the mouth is closed. Taken as level, which a mechanism of unequal sides need not be there: the
/// pose itself would take the forward kinematics.
fn closed_mouth(mechanism: &Mechanism, jaw: &JawConfig) -> Pose {
    Translation3::from(jaw.closed_offset_m) * level(mechanism, jaw.closed_leg_m)
}

/// The platform level on three legs of that mean length, turned as the hinges are and above their middle: the height
/// is found by bisection.
fn level(mechanism: &Mechanism, leg_m: f64) -> Pose {
    let hinges = mechanism.pose_from_corners(&std::array::from_fn(|leg| mechanism.hinge(leg, 0.0)));
    let at_height = |height_m: f64| Pose::translation(0.0, 0.0, height_m) * hinges;
    let mean_leg_m = |height_m: f64| {
        let joints = mechanism.inverse(&at_height(height_m));
        joints.map_or(0.0, |joints| joints.actuators.leg_m.iter().sum::<f64>() / LEGS as f64)
    };
    let (mut low_m, mut high_m) = (0.0, leg_m);
    for _ in 0..60 {
        let middle_m = f64::midpoint(low_m, high_m);
        if mean_leg_m(middle_m) < leg_m { low_m = middle_m } else { high_m = middle_m }
    }
    at_height(low_m)
}

/// At rest, level on legs of the initial length.
fn resting(mechanism: Mechanism, config: &DynamicsConfig) -> Result<Dynamics, PlantError> {
    let pose = level(&mechanism, config.initial_leg_m);
    if let Ok(joints) = mechanism.inverse(&pose)
        && let Err(violation) = mechanism.strokes().check(&joints.actuators)
    {
        return Err(PlantError::Start { initial_leg_m: config.initial_leg_m, violation });
    }
    Ok(Dynamics::new(mechanism, *config, pose)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::check;

    #[test]
    fn what_cannot_work_is_refused_with_its_key() {
        let default = Scenario::default;
        let with = |change: fn(&mut Scenario)| {
            let mut scenario = default();
            change(&mut scenario);
            check(&scenario).unwrap_err().to_string()
        };
        let slow = "can.heartbeat_consumer_ms = 90: use more than can.heartbeat_producer_ms and a cycle";
        let too_fine = "drives.leg.encoder_resolution_m = 0.000000000001: use more";
        let cases: [(String, &str); 20] = [
            (with(|s| s.can.heartbeat_consumer_ms = 50), "can.heartbeat_consumer_ms = 50: use more"),
            (with(|s| s.can.heartbeat_consumer_ms = 51), "can.heartbeat_consumer_ms = 51: use more"),
            (with(|s| (s.rate_hz, s.can.heartbeat_consumer_ms) = (10, 90)), slow),
            (with(|s| s.dynamics.step_ns = 1_000_000), "dynamics.step_ns"),
            (with(|s| s.can.node_ids[3] = 1), "node 1 stands twice"),
            (with(|s| s.can.node_ids[3] = 0), "node id"),
            (with(|s| s.can.node_ids[3] = 127), "master"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4]]), "axis 5 is named 0 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 0]]), "axis 0 is named 2 times"),
            (with(|s| s.can.buses = vec![vec![0, 1, 2], vec![3, 4, 5, 6]]), "axis 6"),
            (with(|s| s.can.buses.push(Vec::new())), "bus 2 has no drive"),
            (with(|s| s.drives.leg.rated_force_n = f64::NAN), "drives.leg.rated_force_n = NaN"),
            (with(|s| s.drives.slide.encoder_noise_m = 1e300), "drives.slide.encoder_noise_m"),
            (with(|s| s.drives.leg.encoder_resolution_m = 1e-12), too_fine),
            (with(|s| s.dynamics.viscous_friction_n_s_per_m = 20_000.0), "a dynamics.step_ns of at most"),
            (with(|s| s.dynamics.slide_friction_n = 60.0), "a dynamics.step_ns of at most"),
            (with(|s| s.dynamics.slide_friction_n = 1e4), "no dynamics.step_ns resolves it"),
            (with(|s| s.dynamics.slide_friction_n = 1e306), "no dynamics.step_ns resolves it"),
            (with(|s| s.dynamics.initial_leg_m = 0.4), "dynamics.initial_leg_m = 0.4: "),
            (with(|s| s.mechanism.strokes.slide_m = [0.001, 0.03]), "initial_leg_m = 0.29: axis d1 at"),
        ];
        for (error, expected) in cases {
            assert!(error.contains(expected), "{error}");
        }
        assert_eq!(check(&default()), Ok(()));
        let boots_within = |start_timeout_s: f64| {
            let mut scenario = Scenario { rate_hz: 10, ..default() };
            scenario.controller.start_timeout_s = start_timeout_s;
            check(&scenario)
        };
        assert!(boots_within(5.0).unwrap_err().to_string().contains("the drives take 12.4 s to boot"));
        assert_eq!(boots_within(12.5), Ok(()));
    }

    #[test]
    fn the_rig_is_switched_on_level_on_its_initial_legs() {
        let scenario = Scenario::default();
        let truth = build_emulation(&scenario, 0).unwrap().truth();
        let [d1, d2, d3, l1, l2, l3] = truth.joint_m;
        for slide_m in [d1, d2, d3] {
            assert!(slide_m.abs() < 1e-12);
        }
        for leg_m in [l1, l2, l3] {
            assert!((leg_m - scenario.dynamics.initial_leg_m).abs() < 1e-9);
        }
    }

    #[test]
    fn the_rig_may_be_switched_on_with_its_legs_at_either_end() {
        for initial_leg_m in Scenario::default().mechanism.strokes.leg_m {
            let mut scenario = Scenario::default();
            scenario.dynamics.initial_leg_m = initial_leg_m;
            assert_eq!(check(&scenario), Ok(()), "{initial_leg_m}");
        }
    }

    #[test]
    fn a_turned_base_starts_level_too() {
        let mut scenario = Scenario::default();
        for (slide, leg_deg) in scenario.mechanism.slides.iter_mut().zip([40.0, 160.0, 280.0]) {
            let (sin, cos) = f64::to_radians(leg_deg).sin_cos();
            slide.centre_m = [0.0577 * cos, 0.0577 * sin];
            slide.azimuth_deg = leg_deg + 90.0;
        }
        let truth = build_emulation(&scenario, 0).unwrap().truth();
        for slide_m in &truth.joint_m[..LEGS] {
            assert!(slide_m.abs() < 1e-9, "{slide_m}");
        }
    }
}
