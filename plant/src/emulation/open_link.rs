//! The emulated drives on simulated wires, for foreign masters, for tools and for other nodes.

use masseter_can::Bus;
use masseter_runtime::messages::Truth;
use masseter_scenario::Scenario;

use super::virtual_link::VirtualLink;
use crate::error::PlantError;
use crate::link::Link;
use crate::link::layout::MASTER_PORT;

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
    /// Free ports of each bus.
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
        self.link.port_at(bus, MASTER_PORT)
    }

    /// The mechanism's true motion at the last SYNC.
    pub fn truth(&self) -> Truth {
        self.link.emulation.truth()
    }

    /// Writes what the drives have stored into the scenario's file (`drives.memory`), if that has changed.
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
        while !matches!(self.link.port_at(bus, port).receive(u64::MAX), Ok(None)) {}
        Some(NodePort { bus, port })
    }

    /// Frees a port.
    pub fn disconnect(&mut self, NodePort { bus, port }: NodePort) {
        self.free[bus].push(port);
    }

    /// A foreign node's access to its bus.
    pub fn port(&mut self, node: &NodePort) -> impl Bus {
        self.link.port_at(node.bus, node.port)
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::{Cob, Expedited, NodeId, ObjectAddress, SdoRequest, SdoResponse};

    use super::*;

    const MS: u64 = 1_000_000;

    /// What the drive of l1 answers.
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
        let joints_m = OpenLink::new(&scenario, 0, 0).unwrap().truth().joint_m;
        assert!(joints_m[..3].iter().any(|slide_m| slide_m.abs() > 1e-3), "{joints_m:?}");
        scenario.dynamics.initial_offset_m = [0.4, 0.0, 0.0];
        assert!(OpenLink::new(&scenario, 0, 0).is_err());
    }
}
