//! The buses of a line: simulated ones with the emulated drives, or real interfaces, each with its clock.

use masseter_can::{Frame, Received, SendError, Tapped};
use masseter_runtime::clock;
use masseter_scenario::Scenario;

use crate::emulation::VirtualLink;
use crate::error::PlantError;
use crate::link::sockets::SocketLink;
use crate::link::{Buses, Link};

/// The buses with their time.
#[derive(Debug)]
pub(super) enum Wires {
    /// Simulated, up to a time, ns.
    Simulated(Box<VirtualLink>, u64),
    Real(SocketLink),
}

/// The same call on either kind of buses.
macro_rules! on_link {
    ($wires:expr, $link:ident => $call:expr) => {
        match $wires {
            Wires::Simulated($link, _) => $call,
            Wires::Real($link) => $call,
        }
    };
}

impl Wires {
    /// The scenario's interfaces, or simulated buses where it names none.
    pub(super) fn open(scenario: &Scenario) -> Result<Self, PlantError> {
        Ok(if scenario.can.is_virtual() {
            Self::Simulated(Box::new(VirtualLink::new(scenario, 0, 0)?), 0)
        } else {
            Self::Real(SocketLink::open(scenario, clock::now_ns())?)
        })
    }

    pub(super) fn now_ns(&self) -> u64 {
        match self {
            Self::Simulated(_, now_ns) => *now_ns,
            Self::Real(_) => clock::now_ns(),
        }
    }

    /// Lets time pass. What emulated drives store meanwhile goes to the file of their memory.
    pub(super) fn pass(&mut self, for_ns: u64) -> Result<(), PlantError> {
        match self {
            Self::Simulated(link, now_ns) => {
                *now_ns += for_ns;
                link.advance(*now_ns)?;
                link.emulation.save_memory()
            }
            Self::Real(_) => {
                clock::sleep_until(clock::now_ns() + for_ns);
                Ok(())
            }
        }
    }

    pub(super) fn send(&mut self, bus: usize, frame: Frame) -> Result<(), SendError> {
        use masseter_can::Bus;
        let now_ns = self.now_ns();
        on_link!(self, link => link.port(bus).send(now_ns, frame))
    }

    /// The next frame of another node. Lost frames show as missing answers.
    pub(super) fn receive(&mut self, bus: usize) -> Option<Received> {
        use masseter_can::Bus;
        let now_ns = self.now_ns();
        on_link!(self, link => link.port(bus).receive(now_ns)).ok().flatten()
    }

    /// The next frame of any node, this one too.
    pub(super) fn tap(&mut self, bus: usize) -> Option<Tapped> {
        let now_ns = self.now_ns();
        on_link!(self, link => link.tap(bus, now_ns)).ok().flatten()
    }
}
