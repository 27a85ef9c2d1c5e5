//! The six emulated drives with their mechanism on real wires: what a robot is to a master.
//!
//! Every drive has a port of its own. The mechanism moves in real time, but only when it is looked at:
//! frames are delivered at their time stamps, and the steps between them are made up for. It has no
//! master and publishes nothing.

use masseter_can::{Bus, OpenError, Received, SocketCan};
use masseter_shared::clock::{self, MILLISECOND_NS};
use masseter_shared::config::Scenario;
use masseter_shared::geometry::AXES;
use masseter_shared::lifecycle::StopRequest;

use crate::build::build_emulation;
use crate::dynamics::DynamicsError;
use crate::emulation::Emulation;
use crate::error::PlantError;
use crate::layout::interfaces_of_axes;

/// How often the drives are stepped at least; between two looks only frames wake them, ns.
const LOOK_NS: u64 = MILLISECOND_NS;
/// How far the mechanism may fall behind; what it cannot make up for is left out and counted, ns.
const BEHIND_NS: u64 = 50 * MILLISECOND_NS;

/// What an emulator did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Figures {
    /// Frames that the drives received, each counted once for every drive.
    pub received: u64,
    /// Frames that they sent.
    pub sent: u64,
    /// Frames that could not be sent.
    pub refused: u64,
    /// Time left out because the machine was too slow, ns.
    pub skipped_ns: u64,
}

/// Drives and mechanism behind their ports.
pub struct Emulator {
    emulation: Emulation,
    ports: [SocketCan; AXES],
    /// The next frame of each drive, fetched but not delivered.
    waiting: [Option<Received>; AXES],
    figures: Figures,
}

impl Emulator {
    /// The scenario's drives, switched on at `now_ns` on the interfaces that it names.
    pub fn open(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let emulation = build_emulation(scenario, now_ns)?;
        let format = scenario.can.format();
        let ports = interfaces_of_axes(&scenario.can)?.map(|interface| SocketCan::open(interface, format));
        let ports: Vec<_> = ports.into_iter().collect::<Result<_, OpenError>>()?;
        let ports = ports.try_into().expect("a port for every axis");
        Ok(Self { emulation, ports, waiting: [None; AXES], figures: Figures::default() })
    }

    /// Lives until it is asked to end.
    pub fn run(mut self, stop: &StopRequest) -> Result<Figures, PlantError> {
        while !stop.is_made() {
            // A frame that came while the others were delivered is fetched already: no port would tell of it.
            if self.earliest().is_none() {
                SocketCan::wait::<AXES>(&self.ports, clock::now_ns() + LOOK_NS);
            }
            self.advance(clock::now_ns())?;
        }
        Ok(self.figures)
    }

    /// Delivers what has arrived and makes the steps due, in the order of time.
    fn advance(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        if now_ns > self.emulation.next_step_ns() + BEHIND_NS {
            self.figures.skipped_ns += self.emulation.skip_to(now_ns);
        }
        loop {
            self.fetch(now_ns);
            let step_ns = self.emulation.next_step_ns();
            match self.earliest() {
                Some((time_ns, axis)) if time_ns <= step_ns => self.deliver(axis, time_ns)?,
                _ if step_ns <= now_ns => self.step(step_ns)?,
                _ => return Ok(()),
            }
        }
    }

    fn fetch(&mut self, now_ns: u64) {
        for (port, waiting) in self.ports.iter_mut().zip(&mut self.waiting) {
            if waiting.is_none() {
                // What an overrun or a dead interface withholds, a drive misses as a real one does.
                *waiting = port.receive(now_ns).unwrap_or(None);
            }
        }
    }

    /// The earliest frame waiting, and for whom.
    fn earliest(&self) -> Option<(u64, usize)> {
        let waiting = self.waiting.iter().enumerate();
        waiting.filter_map(|(axis, waiting)| Some((waiting.as_ref()?.time_ns, axis))).min()
    }

    fn deliver(&mut self, axis: usize, time_ns: u64) -> Result<(), DynamicsError> {
        // A frame that comes later than a step already made cannot be taken back to its time.
        let now_ns = time_ns.max(self.emulation.moved_to_ns());
        if let Some(received) = self.waiting[axis].take() {
            self.figures.received += 1;
            self.emulation.deliver(axis, &received.frame, now_ns)?;
            self.send_outgoing(axis, now_ns);
        }
        Ok(())
    }

    fn step(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        for (axis, port) in self.ports.iter().enumerate() {
            self.emulation.watch_bus(axis, port.status().state);
        }
        self.emulation.step()?;
        (0..AXES).for_each(|axis| self.send_outgoing(axis, now_ns));
        Ok(())
    }

    fn send_outgoing(&mut self, axis: usize, now_ns: u64) {
        while let Some(frame) = self.emulation.outgoing(axis) {
            match self.ports[axis].send(now_ns, frame) {
                Ok(()) => self.figures.sent += 1,
                // The frame is lost, as in a real node; the master misses it.
                Err(_) => self.figures.refused += 1,
            }
        }
    }
}
