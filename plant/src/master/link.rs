//! The plant's connection between master and drives: [`Buses`] for the master, [`Link`] for the core.
//!
//! Here a scenario assigns drives to buses, and faults to wires: node ids become ports, seconds become the wire's time.
//! This module sends and injects nothing.

use std::ops::Range;

use masseter_can::canopen::{Cob, NodeId};
use masseter_can::faults::{Fault, FaultKind, FaultNote};
use masseter_can::{Bus, CanId, Frame, ReceiveError, Tapped};
use masseter_model::geometry::{AXES, LEGS};
use masseter_runtime::clock::{MILLISECOND_NS, SECOND_NS};
use masseter_runtime::injection::{Injected, Injection};
use masseter_runtime::messages::codes::{Cause, EventKind, Source};
use masseter_runtime::messages::{Contact, Event, Truth};
use masseter_runtime::realtime::Waiter;
use masseter_scenario::{BusFault, CanConfig, FaultConfig, FaultKindConfig, MASTER_NODE, Scenario};

use crate::error::{DynamicsError, PlantError};

/// The wires that a master serves.
pub trait Buses {
    /// The master's port on a wire.
    fn port(&mut self, bus: usize) -> impl Bus;
}

/// The wires of a plant: the master's ports, taps, and the truth of emulated drives.
pub trait Link: Buses {
    /// Simulates everything up to `until_ns`; real wires need no such call.
    fn advance(&mut self, _until_ns: u64) -> Result<(), DynamicsError> {
        Ok(())
    }

    /// The next frame or error on a wire up to `now_ns`, from any node.
    fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Tapped>, ReceiveError>;

    /// The next beginning or end of an injected fault up to `now_ns`.
    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote>;

    /// Sets the time of a fault or a stimulus.
    fn set_window(&mut self, injected: Injected, window_ns: Range<u64>);

    /// The next beginning or end of a fault or a stimulus in the emulation; the wires have notes instead.
    fn next_occurrence(&mut self) -> Option<Occurrence> {
        None
    }

    /// The next mishap of the mechanism, an event without its cycle.
    fn next_mishap(&mut self) -> Option<Event> {
        None
    }

    /// The axis of the drive at a port of a simulated wire; none at the master's.
    fn axis_at(&self, _bus: usize, _port: usize) -> Option<usize> {
        None
    }

    /// Waits in real time until frames may have arrived, but not beyond `latest_ns`; returns the time.
    fn wait(&mut self, latest_ns: u64, waiter: &mut Waiter) -> u64;

    /// The mechanism's true motion at the last SYNC, for an emulated mechanism.
    fn truth(&self) -> Option<Truth> {
        None
    }

    /// Value of the load cell at the last SYNC, N; 0 without one.
    fn load_cell_n(&self) -> f64 {
        0.0
    }

    /// The forces between the jaws in the cycle before the last SYNC, for emulated jaws that can touch.
    fn contact(&self) -> Option<Contact> {
        None
    }
}

/// The master's port on every wire.
pub(crate) const MASTER_PORT: usize = 0;

/// The port of an axis' drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) struct DrivePort {
    pub(crate) bus: usize,
    pub(crate) port: usize,
}

/// The port of each axis' drive; those of a bus follow [`MASTER_PORT`].
pub(crate) fn drive_ports(can: &CanConfig) -> Result<[DrivePort; AXES], PlantError> {
    can.check_buses().map_err(|error| PlantError::Scenario(error.to_string()))?;
    let mut ports = [DrivePort { bus: 0, port: MASTER_PORT }; AXES];
    for (bus, axes) in can.buses.iter().enumerate() {
        for (index, &axis) in axes.iter().enumerate() {
            ports[axis] = DrivePort { bus, port: MASTER_PORT + 1 + index };
        }
    }
    Ok(ports)
}

/// The node id of each axis' drive.
pub(crate) fn node_ids(can: &CanConfig) -> Result<[NodeId; AXES], PlantError> {
    let mut ids = [MASTER_NODE; AXES];
    for (axis, &id) in can.node_ids.iter().enumerate() {
        let is_taken = id == MASTER_NODE.get() || can.node_ids[..axis].contains(&id);
        if is_taken {
            let reason = format!("node {id} is listed twice, or is the master's ({MASTER_NODE})");
            return Err(PlantError::Scenario(format!("can.node_ids: {reason}; give every drive its own")));
        }
        ids[axis] = NodeId::new(id)?;
    }
    Ok(ids)
}

/// The address of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize)]
pub struct Address {
    /// Index of the bus.
    pub bus: usize,
    /// The node on it.
    pub node: NodeId,
}

/// The node that sends an object; none for an object that only a master sends.
pub const fn sender(cob: Cob) -> Option<NodeId> {
    match cob {
        Cob::Heartbeat(node) | Cob::Tpdo1(node) | Cob::Emergency(node) | Cob::SdoResponse(node) => Some(node),
        Cob::Nmt | Cob::Sync | Cob::Rpdo1(_) | Cob::SdoRequest(_) => None,
    }
}

/// The address of each axis' drive.
///
/// # Errors
/// [`PlantError`] for buses and node ids that cannot be used.
pub fn addresses(can: &CanConfig) -> Result<[Address; AXES], PlantError> {
    let (ports, ids) = (drive_ports(can)?, node_ids(can)?);
    Ok(std::array::from_fn(|axis| Address { bus: ports[axis].bus, node: ids[axis] }))
}

/// Identifier and data of a babbling node, unless the scenario sets others: only NMT has a higher priority.
const BABBLE_ID: u16 = 0x001;
const BABBLE_DATA: [u8; 8] = [0x55; 8];

/// Seed of a bus' faults: each bus makes choices of its own.
pub(crate) fn fault_seed(scenario: &Scenario, bus: usize) -> u64 {
    scenario.seed.wrapping_add(bus as u64)
}

/// Time from bus-off to the restart of a controller, ns; none without a restart.
pub(crate) fn restart_after_ns(can: &CanConfig) -> Option<u64> {
    (can.restart_ms > 0).then(|| u64::from(can.restart_ms) * MILLISECOND_NS)
}

/// The faults of a bus whose ports have these nodes, switched on at `now_ns`. A fault's number is its index in the
/// scenario's list. A fault with a time unknown at switch-on does not act before its time is set.
pub(crate) fn faults_of_bus(
    scenario: &Scenario,
    bus: usize,
    nodes: &[NodeId],
    now_ns: u64,
) -> Result<Vec<Fault>, PlantError> {
    let injection =
        Injection::new(scenario, now_ns).map_err(|error| PlantError::Scenario(error.to_string()))?;
    let of_bus = scenario.faults.iter().enumerate().filter_map(|(number, config)| {
        let FaultKindConfig::Bus(kind) = config.kind else { return None };
        (config.bus == Some(bus)).then_some((number, kind, config))
    });
    let fault = |(number, kind, config): (usize, BusFault, &FaultConfig)| {
        let window_ns = injection.window_ns(Injected::Fault(number)).unwrap_or(u64::MAX..u64::MAX);
        Ok(Fault {
            number,
            kind: kind_on_wire(kind, config),
            from_ns: window_ns.start,
            until_ns: window_ns.end,
            id: config.id.filter(|_| kind != BusFault::Babble).map(standard),
            port: port_of(config, nodes)?,
            probability: config.probability,
            count: config.count.unwrap_or(if kind == BusFault::BusOff { 1 } else { u64::MAX }),
        })
    };
    of_bus.map(fault).collect()
}

fn kind_on_wire(kind: BusFault, config: &FaultConfig) -> FaultKind {
    match kind {
        BusFault::Corrupt => FaultKind::Corrupt,
        BusFault::Lose => FaultKind::Lose,
        BusFault::Delay => FaultKind::Delay { by_ns: (config.size_si() * SECOND_NS as f64).round() as u64 },
        BusFault::Duplicate => FaultKind::Duplicate,
        BusFault::Babble => {
            let (id, data) = (standard(config.id.unwrap_or(BABBLE_ID)), config.data.as_deref());
            let frame = Frame::new(id, data.unwrap_or(&BABBLE_DATA)).expect("at most 8 bytes");
            FaultKind::Babble { frame }
        }
        BusFault::Disconnect => FaultKind::Disconnect,
        BusFault::BusOff => FaultKind::BusOff,
    }
}

fn standard(id: u16) -> CanId {
    CanId::standard(id & 0x7FF).expect("11 bits")
}

fn port_of(config: &FaultConfig, nodes: &[NodeId]) -> Result<Option<usize>, PlantError> {
    let Some(node) = config.node else { return Ok(None) };
    if let Some(port) = nodes.iter().position(|id| id.get() == node) {
        return Ok(Some(port));
    }
    let present = nodes.iter().map(|id| id.get().to_string()).collect::<Vec<_>>().join(", ");
    let bus = config.bus.unwrap_or_default();
    Err(PlantError::Scenario(format!("faults.node = {node}: bus {bus} has the nodes {present}")))
}

/// Refuses the first quantity that contradicts others.
pub(crate) fn check_quantities(scenario: &Scenario) -> Result<(), PlantError> {
    let Scenario { drives, mechanism, can, .. } = scenario;
    let (period_ns, refuse) = (scenario.period_ns(), |text| Err(PlantError::Scenario(text)));
    // A drive counts increments in 32 bits (objects 6064h and 607Ah).
    for (key, axis) in [("drives.slide", 0), ("drives.leg", LEGS)] {
        let increment_m = drives.of_axis(axis).encoder_resolution_m;
        let [low_m, high_m] = mechanism.strokes.of_axis(axis);
        if low_m.abs().max(high_m.abs()) / increment_m > f64::from(i32::MAX) {
            let need = "use more: the end of the stroke does not fit into 32 bits";
            return refuse(format!("{key}.encoder_resolution_m = {increment_m}: {need}"));
        }
    }
    // The master's heartbeat ends the first cycle with a SYNC after the interval, and is queued once the command has
    // come.
    let interval_ns = u64::from(can.heartbeat_producer_ms) * MILLISECOND_NS;
    let longest_ns = (interval_ns / period_ns + 2) * period_ns;
    if u64::from(can.heartbeat_consumer_ms) * MILLISECOND_NS < longest_ns {
        let need = "use at least can.heartbeat_producer_ms and two cycles (2000 / rate_hz) together";
        return refuse(format!("can.heartbeat_consumer_ms = {}: {need}", can.heartbeat_consumer_ms));
    }
    // Jitter may leave two cycles between two process data.
    match can.rpdo_timeout_ms {
        Some(timeout_ms @ 1..) if u64::from(timeout_ms) * MILLISECOND_NS <= 2 * period_ns => {
            let need = "use 0 for none, or more than two cycles (2000 / rate_hz)";
            refuse(format!("can.rpdo_timeout_ms = {timeout_ms}: {need}"))
        }
        _ => Ok(()),
    }
}

/// The beginning or the end of a fault or a stimulus.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Occurrence {
    /// Which.
    pub injected: Injected,
    /// When, ns.
    pub time_ns: u64,
    /// The axis concerned, if there is one.
    pub axis: Option<usize>,
    /// Whether this is the end.
    pub has_ended: bool,
}

impl Occurrence {
    /// The event that reports it.
    pub(crate) fn event(&self, cycle: u64) -> Event {
        let Self { injected, time_ns, axis, has_ended } = *self;
        let (place, cause) = match (injected, has_ended) {
            (Injected::Fault(place), false) => (place, Cause::FaultInjected),
            (Injected::Fault(place), true) => (place, Cause::FaultEnded),
            (Injected::Stimulus(place), false) => (place, Cause::StimulusBegan),
            (Injected::Stimulus(place), true) => (place, Cause::StimulusEnded),
        };
        let event = Event::new(Source::Scenario, EventKind::Notice, cause);
        let axis = axis.map_or(event.axis, |axis| axis as u32);
        Event { time_ns, cycle, axis, value: (place + 1) as f64, limit: 1.0, ..event }
    }
}
