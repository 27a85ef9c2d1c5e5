//! The master's ports on all buses, for a client in place of the master: one that waits for answers.
//!
//! The buses are simulated ones with the emulated drives, or real interfaces, each with its clock.

use masseter_can::{Bus, Frame, ReceiveError, Received, SendError, Tapped};
use masseter_runtime::clock;
use masseter_scenario::Scenario;

use crate::error::PlantError;
use crate::master::link::{Buses, Link};
use crate::{master::sockets::SocketLink, simulator::emulation::virtual_link::VirtualLink};

/// The buses with their time.
#[derive(Debug)]
pub struct Wires(Kind);

#[derive(Debug)]
enum Kind {
    /// Simulated with the emulated drives, up to a time, ns.
    Simulated(Box<VirtualLink>, u64),
    /// The interfaces, in real time.
    Real(SocketLink),
}

/// The same call on either kind of buses.
macro_rules! on_link {
    ($wires:expr, $link:ident => $call:expr) => {
        match &mut $wires.0 {
            Kind::Simulated($link, _) => $call,
            Kind::Real($link) => $call,
        }
    };
}

impl Wires {
    /// The scenario's interfaces, or simulated buses where it names none.
    ///
    /// # Errors
    /// [`PlantError`] for interfaces that cannot be opened and for buses that cannot be built.
    pub fn open(scenario: &Scenario) -> Result<Self, PlantError> {
        Ok(Self(if scenario.can.is_virtual() {
            Kind::Simulated(Box::new(VirtualLink::new(scenario, 0, 0)?), 0)
        } else {
            Kind::Real(SocketLink::open(scenario, clock::now_ns())?)
        }))
    }

    /// Whether these are interfaces in real time.
    pub fn are_real(&self) -> bool {
        matches!(self.0, Kind::Real(_))
    }

    /// The present time, ns: simulated from 0, or the machine's.
    pub fn now_ns(&self) -> u64 {
        match &self.0 {
            Kind::Simulated(_, now_ns) => *now_ns,
            Kind::Real(_) => clock::now_ns(),
        }
    }

    /// Lets time pass. Writes values that emulated drives store meanwhile to the file of their memory.
    ///
    /// # Errors
    /// [`PlantError`] for a mechanism that cannot be moved on, and for a file that cannot be written.
    pub fn pass(&mut self, for_ns: u64) -> Result<(), PlantError> {
        match &mut self.0 {
            Kind::Simulated(link, now_ns) => {
                *now_ns += for_ns;
                link.advance(*now_ns)?;
                link.emulation.save_memory()
            }
            Kind::Real(_) => {
                clock::sleep_until(clock::now_ns() + for_ns);
                Ok(())
            }
        }
    }

    /// Queues a frame for a bus.
    ///
    /// # Errors
    /// [`SendError`].
    pub fn send(&mut self, bus: usize, frame: Frame) -> Result<(), SendError> {
        let now_ns = self.now_ns();
        on_link!(self, link => link.port(bus).send(now_ns, frame))
    }

    /// The next frame of another node.
    ///
    /// # Errors
    /// [`ReceiveError`].
    pub fn receive(&mut self, bus: usize) -> Result<Option<Received>, ReceiveError> {
        let now_ns = self.now_ns();
        on_link!(self, link => link.port(bus).receive(now_ns))
    }

    /// The next frame of any node, this one too; none also after an error.
    pub fn tap(&mut self, bus: usize) -> Option<Tapped> {
        let now_ns = self.now_ns();
        on_link!(self, link => link.tap(bus, now_ns)).ok().flatten()
    }
}
