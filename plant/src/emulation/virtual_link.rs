//! Simulated wires with the emulated drives on them, for a master on port 0 and for free ports.

use std::ops::Range;

use masseter_can::faults::{FaultNote, Faults};
use masseter_can::{Bus, ReceiveError, Tapped, VirtualWire, WireConfig};
use masseter_model::geometry::AXES;
use masseter_runtime::injection::Injected;
use masseter_runtime::messages::{Contact, Truth};
use masseter_runtime::realtime::Waiter;
use masseter_scenario::{MASTER_NODE, Scenario};

use super::co_simulation::Emulation;
use crate::error::PlantError;
use crate::injection::{Mishap, Occurrence};
use crate::link::faults::{fault_seed, faults_of_bus, restart_after_ns};
use crate::link::layout::{DrivePort, MASTER_PORT, drive_ports, node_ids};
use crate::link::{Buses, Link};
use crate::mechanism::DynamicsError;

/// Frames that a port can hold for sending, and for receiving between two looks; a millisecond holds 21.
const TRANSMIT_CAPACITY: usize = 64;
const RECEIVE_CAPACITY: usize = 256;

/// Simulated wires and the emulated drives on them, co-simulated event by event in the order of time.
#[derive(Debug)]
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

    fn set_window(&mut self, injected: Injected, window_ns: Range<u64>) {
        if let Injected::Fault(number) = injected {
            self.wires.iter_mut().for_each(|wire| wire.set_fault_window(number, window_ns.clone()));
        }
        self.emulation.set_window(injected, window_ns);
    }

    fn next_occurrence(&mut self) -> Option<Occurrence> {
        self.emulation.next_occurrence()
    }

    fn next_mishap(&mut self) -> Option<(u64, Mishap)> {
        self.emulation.next_mishap()
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
        self.emulation.load_cell_n()
    }

    fn contact(&self) -> Option<Contact> {
        self.emulation.contact()
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

    /// A port on a wire: the master's is followed by those of the drives, then by the free ones.
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
