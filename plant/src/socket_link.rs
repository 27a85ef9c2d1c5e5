//! The robot: real wires, on which the drives hang. Nothing is known of the mechanism but what they tell.

use masseter_shared::can::{Bus, OpenError, ReceiveError, SocketCan, Tapped};
use masseter_shared::messages::Truth;

use crate::link::{Buses, Link};
use crate::mechanism::DynamicsError;

/// The master's port and a tap on every wire.
#[derive(Debug)]
pub struct SocketLink {
    ports: Vec<SocketCan>,
    taps: Vec<SocketCan>,
}

impl SocketLink {
    /// Opens the interfaces, one a bus.
    pub(crate) fn open(interfaces: &[String]) -> Result<Self, OpenError> {
        let open = || interfaces.iter().map(|interface| SocketCan::open(interface)).collect::<Result<_, _>>();
        Ok(Self { ports: open()?, taps: open()? })
    }
}

impl Buses for SocketLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        &mut self.ports[bus]
    }
}

impl Link for SocketLink {
    fn advance(&mut self, _: u64) -> Result<(), DynamicsError> {
        Ok(())
    }

    fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Tapped>, ReceiveError> {
        Ok(self.taps[bus].receive(now_ns)?.map(|received| Tapped::Frame(received.into())))
    }

    fn truth(&self) -> Option<Truth> {
        None
    }
}
