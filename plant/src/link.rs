//! What the master is connected to: simulated wires with the emulated drives on them, or the robot.
//!
//! The master sees [`Buses`] either way; the plant around it sees [`Link`].

use masseter_can::faults::FaultNote;
use masseter_can::{Bus, ReceiveError, Tapped, VirtualWire};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::Truth;

use crate::dynamics::DynamicsError;
use crate::emulation::Emulation;

/// The wires that a master serves.
pub trait Buses {
    /// The master's port on a wire.
    fn port(&mut self, bus: usize) -> impl Bus;
}

/// The wires with what a plant needs of them beyond the master's ports.
pub trait Link: Buses {
    /// Lets everything happen that happens up to `until_ns`; on real wires it does so by itself.
    fn advance(&mut self, until_ns: u64) -> Result<(), DynamicsError>;

    /// The next frame or error that a tap on a wire saw up to `now_ns`, whoever caused it.
    fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Tapped>, ReceiveError>;

    /// What the faults injected into a wire did up to `now_ns`, one note at a time.
    fn next_note(&mut self, bus: usize, now_ns: u64) -> Option<FaultNote>;

    /// The axis whose drive is at a port of a simulated wire; none at the master's.
    fn axis_at(&self, _bus: usize, _port: usize) -> Option<usize> {
        None
    }

    /// What the mechanism did at the last SYNC, where it is emulated here.
    fn truth(&self) -> Option<Truth>;
}

/// The master's port on every wire.
pub(crate) const MASTER_PORT: usize = 0;

/// Where an axis' drive hangs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) bus: usize,
    pub(crate) port: usize,
}

/// Simulated wires and the emulated drives on them, co-simulated event by event in the order of time.
#[derive(Debug)]
pub struct VirtualLink {
    wires: Vec<VirtualWire>,
    places: [Place; AXES],
    emulation: Emulation,
}

impl Buses for VirtualLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        self.wires[bus].port(MASTER_PORT)
    }
}

impl Link for VirtualLink {
    fn advance(&mut self, until_ns: u64) -> Result<(), DynamicsError> {
        loop {
            let step_ns = self.emulation.next_step_ns();
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

    fn axis_at(&self, bus: usize, port: usize) -> Option<usize> {
        self.places.iter().position(|place| *place == Place { bus, port })
    }

    fn truth(&self) -> Option<Truth> {
        Some(self.emulation.truth())
    }
}

impl VirtualLink {
    /// Drives in the order of `places` on their wires.
    pub(crate) fn new(wires: Vec<VirtualWire>, places: [Place; AXES], emulation: Emulation) -> Self {
        Self { wires, places, emulation }
    }

    /// The drives and the mechanism.
    #[cfg(test)]
    pub(crate) fn emulation(&self) -> &Emulation {
        &self.emulation
    }

    /// Any port on a wire: 0 is the master's, those of the drives follow, then the free ones.
    pub(crate) fn port_at(&mut self, bus: usize, port: usize) -> impl Bus {
        self.wires[bus].port(port)
    }

    /// When the next frame arrives or the drives make their next step: until then nothing changes unless a frame is
    /// queued, ns.
    pub(crate) fn next_event_ns(&mut self) -> u64 {
        let step_ns = self.emulation.next_step_ns();
        self.next_arrival().map_or(step_ns, |(time_ns, _)| time_ns.min(step_ns))
    }

    /// The next frame to arrive on any wire.
    fn next_arrival(&mut self) -> Option<(u64, usize)> {
        let arrivals = self.wires.iter_mut().enumerate();
        arrivals.filter_map(|(bus, wire)| Some((wire.next_event_ns()?, bus))).min()
    }

    /// A frame arrives: the drives on the wire take it where their axes stand at that instant.
    fn arrive(&mut self, bus: usize, now_ns: u64) -> Result<(), DynamicsError> {
        let wire = &mut self.wires[bus];
        wire.advance(now_ns);
        let at_bus = self.places.iter().enumerate().filter(|(_, place)| place.bus == bus);
        for (axis, &Place { port, .. }) in at_bus {
            // An overrun has lost the drive's newest frames, as in a real node; the older ones follow.
            while let Ok(Some(received)) = wire.receive(port, now_ns) {
                self.emulation.deliver(axis, &received.frame, now_ns)?;
            }
            send_outgoing(&mut self.emulation, axis, wire, port, now_ns);
        }
        Ok(())
    }

    fn step_drives(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        for (axis, &Place { bus, port }) in self.places.iter().enumerate() {
            self.emulation.watch_bus(axis, self.wires[bus].status(port).state);
        }
        self.emulation.step()?;
        for (axis, &Place { bus, port }) in self.places.iter().enumerate() {
            send_outgoing(&mut self.emulation, axis, &mut self.wires[bus], port, now_ns);
        }
        Ok(())
    }
}

fn send_outgoing(emulation: &mut Emulation, axis: usize, wire: &mut VirtualWire, port: usize, now_ns: u64) {
    while let Some(frame) = emulation.outgoing(axis) {
        // A full transmit queue or a controller off the bus loses the frame, as in a real node; the
        // master misses it.
        let _ = wire.send(port, now_ns, frame);
    }
}
