//! Simulated wires with the emulated drives on them, for a master on port 0, and for foreign masters and nodes.

use std::ops::Range;

use masseter_can::faults::{FaultNote, Faults};
use masseter_can::{Bus, ReceiveError, Tapped, VirtualWire, WireConfig};
use masseter_model::geometry::AXES;
use masseter_runtime::messages::{Contact, Event, Truth};
use masseter_runtime::{injection::Injected, realtime::Waiter};
use masseter_scenario::{MASTER_NODE, Scenario};

use super::Emulation;
use crate::error::{DynamicsError, PlantError};
use crate::master::link::{
    Buses, DrivePort, Link, MASTER_PORT, Occurrence, drive_ports, fault_seed, faults_of_bus, node_ids,
    restart_after_ns,
};

/// Frames that a port can hold for sending, and for receiving between two looks; a millisecond holds 21.
const TRANSMIT_CAPACITY: usize = 64;
const RECEIVE_CAPACITY: usize = 256;

/// Simulated wires and the emulated drives on them, co-simulated event by event in the order of time.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct VirtualLink {
    wires: Vec<VirtualWire>,
    ports: [DrivePort; AXES],
    pub(crate) emulation: Emulation,
}

impl Buses for VirtualLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        self.wires[bus].port(MASTER_PORT)
    }
}

impl Link for VirtualLink {
    fn advance(&mut self, until_ns: u64) -> Result<(), DynamicsError> {
        loop {
            let step_ns = self.emulation.next_step_ns;
            let (time_ns, bus) = match self.next_arrival() {
                Some((time_ns, bus)) if time_ns <= step_ns => (time_ns, Some(bus)),
                _ => (step_ns, None),
            };
            if time_ns > until_ns {
                break;
            }
            match bus {
                Some(bus) => self.arrive(bus, time_ns)?,
                None => self.step_drives(time_ns)?,
            }
        }
        self.wires.iter_mut().for_each(|wire| wire.advance(until_ns));
        Ok(())
    }

    fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.wires[bus].tap(now_ns)
    }

    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote> {
        self.wires[bus].next_note(now_ns)
    }

    fn set_window(&mut self, injected: Injected, window_ns: Range<u64>) {
        if let Injected::Fault(number) = injected {
            self.wires.iter_mut().for_each(|wire| wire.set_fault_window(number, window_ns.clone()));
        }
        self.emulation.agenda.set_window(injected, &window_ns);
    }

    fn next_occurrence(&mut self) -> Option<Occurrence> {
        self.emulation.agenda.occurrences.pop_front()
    }

    fn next_mishap(&mut self) -> Option<Event> {
        self.emulation.mishaps.iter_mut().find_map(Option::take)
    }

    fn axis_at(&self, bus: usize, port: usize) -> Option<usize> {
        self.ports.iter().position(|at| *at == DrivePort { bus, port })
    }

    fn wait(&mut self, latest_ns: u64, waiter: &mut Waiter) -> u64 {
        waiter.until_between(self.next_event_ns().min(latest_ns), latest_ns)
    }

    fn truth(&self) -> Option<Truth> {
        Some(self.emulation.truth())
    }

    fn load_cell_n(&self) -> f64 {
        self.emulation.sample.load_cell_n
    }

    fn contact(&self) -> Option<Contact> {
        self.emulation.contact
    }
}

impl VirtualLink {
    /// The scenario's drives on simulated wires, switched on at `now_ns`, with this many free ports on each wire.
    pub(crate) fn new(scenario: &Scenario, free_ports: usize, now_ns: u64) -> Result<Self, PlantError> {
        let emulation = Emulation::new(scenario, now_ns)?;
        let ports = drive_ports(&scenario.can)?;
        let wire = |bus| wire(scenario, bus, free_ports, now_ns);
        let wires = (0..scenario.can.buses.len()).map(wire).collect::<Result<_, _>>()?;
        Ok(Self { wires, ports, emulation })
    }

    /// Time of the next arrival or of the drives' next step, ns. Until then only a queued frame changes anything.
    pub(crate) fn next_event_ns(&mut self) -> u64 {
        let step_ns = self.emulation.next_step_ns;
        self.next_arrival().map_or(step_ns, |(time_ns, _)| time_ns.min(step_ns))
    }

    /// The next frame to arrive on any wire.
    fn next_arrival(&mut self) -> Option<(u64, usize)> {
        let arrivals = self.wires.iter_mut().enumerate();
        arrivals.filter_map(|(bus, wire)| Some((wire.next_event_ns()?, bus))).min()
    }

    /// Delivers the frames that arrive on a wire at this instant to its drives.
    fn arrive(&mut self, bus: usize, now_ns: u64) -> Result<(), DynamicsError> {
        self.wires[bus].advance(now_ns);
        for (axis, at) in self.ports.into_iter().enumerate().filter(|(_, at)| at.bus == bus) {
            // An overrun loses the drive's newest frames, as in a real node; the older ones follow.
            while let Ok(Some(received)) = self.wires[bus].port(at.port).receive(now_ns) {
                self.emulation.deliver(axis, &received.frame, now_ns)?;
            }
            self.send_outgoing(axis, now_ns);
        }
        Ok(())
    }

    fn step_drives(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        for (axis, &DrivePort { bus, port }) in self.ports.iter().enumerate() {
            self.emulation.set_error_state(axis, self.wires[bus].port(port).status().state);
        }
        self.emulation.step()?;
        (0..AXES).for_each(|axis| self.send_outgoing(axis, now_ns));
        Ok(())
    }

    fn send_outgoing(&mut self, axis: usize, now_ns: u64) {
        let DrivePort { bus, port } = self.ports[axis];
        while let Some(frame) = self.emulation.outgoing(axis) {
            // A full transmit queue or a controller in bus-off loses the frame, as in a real node; the master detects the
            // loss.
            let _ = self.wires[bus].port(port).send(now_ns, frame);
        }
    }
}

fn wire(scenario: &Scenario, bus: usize, free_ports: usize, now_ns: u64) -> Result<VirtualWire, PlantError> {
    let can = &scenario.can;
    let ids = node_ids(can)?;
    let drives = can.buses[bus].iter().map(|&axis| ids[axis]);
    let nodes: Vec<_> = std::iter::once(MASTER_NODE).chain(drives).collect();
    let config = WireConfig {
        bitrate: can.bitrate()?,
        ports: nodes.len() + free_ports,
        transmit_capacity: TRANSMIT_CAPACITY,
        receive_capacity: RECEIVE_CAPACITY,
        restart_after_ns: restart_after_ns(can),
    };
    let faults = faults_of_bus(scenario, bus, &nodes, now_ns)?;
    Ok(VirtualWire::with_faults(&config, Faults::new(faults, fault_seed(scenario, bus))))
}

/// Drives, mechanism and wires, with the port of a master and free ports for other nodes.
///
/// A tool of one thread is the master itself:
///
/// ```
/// use masseter_can::canopen::{Cob, NodeId, ObjectAddress, SdoRequest};
/// use masseter_can::Bus;
/// use masseter_plant::emulation::OpenLink;
/// use masseter_scenario::Scenario;
///
/// let mut link = OpenLink::new(&Scenario::default(), 0, 0)?;
/// let (node, mut now_ns) = (NodeId::new(1)?, 100_000_000);
/// link.advance(now_ns)?;
/// let request = SdoRequest::InitiateUpload { object: ObjectAddress::new(0x6041, 0) };
/// link.master(0).send(now_ns, request.frame(node))?;
/// let answer = loop {
///     now_ns += 1_000_000;
///     link.advance(now_ns)?;
///     match link.master(0).receive(now_ns)? {
///         Some(received) if Cob::try_from(received.frame.id())? == Cob::SdoResponse(node) => break received,
///         _ => {}
///     }
/// };
/// assert_eq!(answer.frame.data()[1..3], [0x41, 0x60]);
/// link.save_memory()?;
/// # Ok::<_, Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct OpenLink {
    link: VirtualLink,
    /// Free ports of each bus, which follow those of the master and of the drives.
    free: Vec<Vec<usize>>,
}

/// The port of a foreign node on a bus.
#[derive(Debug, PartialEq, Eq)]
pub struct NodePort {
    bus: usize,
    port: usize,
}

impl OpenLink {
    /// The scenario's drives, switched on at `now_ns`, with this many free ports on each bus.
    pub fn new(scenario: &Scenario, others: usize, now_ns: u64) -> Result<Self, PlantError> {
        let link = VirtualLink::new(scenario, others, now_ns)?;
        let ports = |axes: &Vec<usize>| (1 + axes.len()..1 + axes.len() + others).rev().collect();
        Ok(Self { link, free: scenario.can.buses.iter().map(ports).collect() })
    }

    /// Number of buses.
    pub fn buses(&self) -> usize {
        self.free.len()
    }

    /// The master's port on a bus.
    ///
    /// # Panics
    /// Where there is no such bus.
    pub fn master(&mut self, bus: usize) -> impl Bus {
        self.link.port(bus)
    }

    /// Writes the drives' changed stored values into the scenario's file (`drives.memory`).
    ///
    /// # Errors
    /// [`PlantError::Memory`] for a file that cannot be written.
    pub fn save_memory(&mut self) -> Result<(), PlantError> {
        self.link.emulation.save_memory()
    }

    /// Simulates everything up to `now_ns`.
    pub fn advance(&mut self, now_ns: u64) -> Result<(), PlantError> {
        Ok(self.link.advance(now_ns)?)
    }

    /// Takes a free port of a bus; none when there is no such bus or no free port.
    pub fn connect(&mut self, bus: usize) -> Option<NodePort> {
        let port = self.free.get_mut(bus)?.pop()?;
        // Frames that the port received while it was free are discarded.
        while !matches!(self.link.wires[bus].port(port).receive(u64::MAX), Ok(None)) {}
        Some(NodePort { bus, port })
    }

    /// Frees a port.
    pub fn disconnect(&mut self, NodePort { bus, port }: NodePort) {
        self.free[bus].push(port);
    }

    /// A foreign node's access to its bus.
    pub fn port(&mut self, node: &NodePort) -> impl Bus {
        self.link.wires[node.bus].port(node.port)
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::{Cob, Expedited, NodeId, ObjectAddress, SdoRequest, SdoResponse};

    use super::*;

    const MS: u64 = 1_000_000;

    /// The answer of the drive of l1.
    fn ask(link: &mut OpenLink, now_ns: &mut u64, request: SdoRequest) -> SdoResponse {
        let node = NodeId::new(4).unwrap();
        link.master(1).send(*now_ns, request.frame(node)).unwrap();
        for _ in 0..20 {
            *now_ns += MS;
            link.advance(*now_ns).unwrap();
            while let Some(received) = link.master(1).receive(*now_ns).unwrap() {
                if received.frame.id() == Cob::SdoResponse(node).into() {
                    return SdoResponse::decode(received.frame.data()).unwrap();
                }
            }
        }
        panic!("no answer");
    }

    #[test]
    fn what_a_master_has_saved_is_there_for_the_next_process() {
        let path = std::env::temp_dir().join(format!("masseter-memory-{}.json", std::process::id()));
        let mut scenario = Scenario::default();
        scenario.drives.memory = Some(path.clone());
        let object = ObjectAddress::new(0x6065, 0);
        let write =
            |object, data: &[u8]| SdoRequest::Download { object, data: Expedited::new(data).unwrap() };

        let (mut link, mut now_ns) = (OpenLink::new(&scenario, 0, 0).unwrap(), 100 * MS);
        link.advance(now_ns).unwrap();
        link.save_memory().unwrap();
        assert!(!path.exists(), "nothing is stored yet");
        ask(&mut link, &mut now_ns, write(object, &777_u32.to_le_bytes()));
        ask(&mut link, &mut now_ns, write(ObjectAddress::new(0x1010, 1), b"save"));
        link.save_memory().unwrap();

        let (mut next, mut now_ns) = (OpenLink::new(&scenario, 0, 0).unwrap(), 100 * MS);
        next.advance(now_ns).unwrap();
        let answer = ask(&mut next, &mut now_ns, SdoRequest::InitiateUpload { object });
        let SdoResponse::Upload { data, .. } = answer else { panic!("{answer:?}") };
        assert_eq!(data.data(), 777_u32.to_le_bytes());

        std::fs::write(&path, "{ \"x1\": {} }").unwrap();
        let refusal = OpenLink::new(&scenario, 0, 0).unwrap_err().to_string();
        assert!(refusal.contains("'x1' is no axis") && refusal.contains("remove it"), "{refusal}");
        std::fs::write(&path, "{ \"l1\": { \"values\": { \"6065:09\": 1 } } }").unwrap();
        let refusal = OpenLink::new(&scenario, 0, 0).unwrap_err().to_string();
        assert!(refusal.contains("l1: 6065:09: the drive has no such object"), "{refusal}");
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn the_jaw_can_stand_beside_its_place_and_all_six_axes_agree() {
        let mut scenario = Scenario::default();
        scenario.dynamics.initial_offset_m = [0.004, -0.003, 0.0];
        let joints_m = OpenLink::new(&scenario, 0, 0).unwrap().link.emulation.truth().joint_m;
        assert!(joints_m[..3].iter().any(|slide_m| slide_m.abs() > 1e-3), "{joints_m:?}");
        scenario.dynamics.initial_offset_m = [0.4, 0.0, 0.0];
        assert!(OpenLink::new(&scenario, 0, 0).is_err());
    }
}
