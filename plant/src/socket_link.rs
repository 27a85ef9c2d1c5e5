//! The robot: real wires, on which the drives hang. Nothing is known of the mechanism but what they tell.

use masseter_can::PortFaults;
use masseter_can::faults::FaultNote;
use masseter_can::{Bus, FrameFormat, ReceiveError, SocketCan, Tapped};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Truth;

use crate::claim::Claim;
use crate::dynamics::DynamicsError;
use crate::error::PlantError;
use crate::link::{Buses, Link};

/// The master's port, the faults laid over it, and a tap on every wire.
#[derive(Debug)]
pub struct SocketLink {
    ports: Vec<SocketCan>,
    faults: Vec<PortFaults>,
    taps: Vec<SocketCan>,
    _claims: Vec<Claim>,
}

impl SocketLink {
    /// Opens the interfaces, one a bus, each with the faults of the master's port there, to send in that format.
    pub(crate) fn open(
        interfaces: &[String],
        format: FrameFormat,
        faults: Vec<PortFaults>,
    ) -> Result<Self, PlantError> {
        let port = |interface: &String| SocketCan::open(interface, format);
        let open = || interfaces.iter().map(port).collect::<Result<_, _>>();
        let (ports, taps) = (open()?, open()?);
        let claims = interfaces.iter().map(|interface| Claim::on(interface)).collect::<Result<_, _>>()?;
        Ok(Self { ports, faults, taps, _claims: claims })
    }
}

impl SocketLink {
    /// Blocks until a frame for the master arrives on a wire, at most until `until_ns`.
    pub(crate) fn wait_for_frame(&self, until_ns: u64) {
        SocketCan::wait::<AXES>(&self.ports, until_ns);
    }
}

impl Buses for SocketLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        self.faults[bus].over(&mut self.ports[bus])
    }
}

impl Link for SocketLink {
    fn advance(&mut self, _: u64) -> Result<(), DynamicsError> {
        Ok(())
    }

    fn tap(&mut self, bus: usize, _: u64) -> Result<Option<Tapped>, ReceiveError> {
        self.taps[bus].tap()
    }

    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote> {
        self.faults[bus].next_note(now_ns)
    }

    fn truth(&self) -> Option<Truth> {
        None
    }
}
