//! The emulated drives on real interfaces: a robot for any master.
//!
//! Every drive has a socket of its own. The mechanism moves in real time: the emulator delivers frames at their time
//! stamps, and catches up the steps between them. The emulator has no master and publishes nothing.

use masseter_can::{Bus, OpenError, Received, SocketCan};
use masseter_model::geometry::AXES;
use masseter_runtime::clock::{self, MILLISECOND_NS};
use masseter_runtime::lifecycle::StopRequest;
use masseter_scenario::Scenario;

use super::Emulation;
use crate::error::{DynamicsError, PlantError};
use crate::{master::link::drive_ports, master::sockets::refuse_unfit};

/// The longest wait for a frame: the drives are stepped at least this often, ns.
const LONGEST_WAIT_NS: u64 = MILLISECOND_NS;
/// The longest delay that the mechanism catches up; steps beyond it are skipped and counted, ns.
const LONGEST_DELAY_NS: u64 = 50 * MILLISECOND_NS;

/// Counters of an emulator.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct EmulatorCounters {
    /// Frames received, counted once for every drive that received them.
    pub received: u64,
    /// Frames sent.
    pub sent: u64,
    /// Frames that could not be sent.
    pub refused: u64,
    /// Time skipped because the machine was too slow, ns.
    pub skipped_ns: u64,
}

/// Drives and mechanism on real interfaces.
///
/// ```no_run
/// use masseter_plant::emulation::Emulator;
/// use masseter_runtime::clock;
/// use masseter_scenario::Scenario;
/// use masseter_runtime::lifecycle::StopRequest;
///
/// let mut scenario = Scenario::default();
/// scenario.can.interfaces = vec!["vcan0".to_owned(), "vcan1".to_owned()];
/// let stop = StopRequest::listen_alone()?;
/// let counters = Emulator::open(&scenario, clock::now_ns())?.run(&stop)?;
/// println!("{} frames received, {} sent", counters.received, counters.sent);
/// # Ok::<_, Box<dyn std::error::Error>>(())
/// ```
pub struct Emulator {
    emulation: Emulation,
    ports: [SocketCan; AXES],
    /// The next frame of each drive, fetched but not delivered.
    waiting: [Option<Received>; AXES],
    counters: EmulatorCounters,
}

impl Emulator {
    /// The scenario's drives, switched on at `now_ns` on the interfaces that it names.
    pub fn open(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let emulation = Emulation::new(scenario, now_ns)?;
        refuse_unfit(&scenario.can)?;
        let interfaces = drive_ports(&scenario.can)?.map(|at| &scenario.can.interfaces[at.bus]);
        let ports = interfaces.map(|interface| SocketCan::open(interface));
        let ports: Vec<_> = ports.into_iter().collect::<Result<_, OpenError>>()?;
        let ports = ports.try_into().expect("a port for every axis");
        Ok(Self { emulation, ports, waiting: [None; AXES], counters: EmulatorCounters::default() })
    }

    /// Runs until `stop` is requested.
    pub fn run(mut self, stop: &StopRequest) -> Result<EmulatorCounters, PlantError> {
        while !stop.is_made() {
            // A frame that arrived during the last deliveries is already fetched: no socket wakes for this frame.
            if self.earliest().is_none() {
                SocketCan::wait::<AXES>(&self.ports, clock::now_ns() + LONGEST_WAIT_NS);
            }
            self.advance(clock::now_ns())?;
            self.emulation.save_memory()?;
        }
        Ok(self.counters)
    }

    /// Delivers the frames that have arrived and makes the steps that are due, in the order of time.
    fn advance(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        if now_ns > self.emulation.next_step_ns + LONGEST_DELAY_NS {
            self.counters.skipped_ns += self.emulation.skip_to(now_ns);
        }
        loop {
            self.fetch(now_ns);
            let step_ns = self.emulation.next_step_ns;
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
                // A drive misses the frames lost by an overrun or a dead interface, as a real one does.
                *waiting = port.receive(now_ns).unwrap_or(None);
            }
        }
    }

    /// Time stamp and axis of the earliest frame waiting.
    fn earliest(&self) -> Option<(u64, usize)> {
        let waiting = self.waiting.iter().enumerate();
        waiting.filter_map(|(axis, waiting)| Some((waiting.as_ref()?.time_ns, axis))).min()
    }

    fn deliver(&mut self, axis: usize, time_ns: u64) -> Result<(), DynamicsError> {
        // A frame older than a step already made is delivered at the time of that step.
        let now_ns = time_ns.max(self.emulation.moved_to_ns);
        if let Some(received) = self.waiting[axis].take() {
            self.counters.received += 1;
            self.emulation.deliver(axis, &received.frame, now_ns)?;
            self.send_outgoing(axis, now_ns);
        }
        Ok(())
    }

    fn step(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        for (axis, port) in self.ports.iter().enumerate() {
            self.emulation.set_error_state(axis, port.status().state);
        }
        self.emulation.step()?;
        (0..AXES).for_each(|axis| self.send_outgoing(axis, now_ns));
        Ok(())
    }

    fn send_outgoing(&mut self, axis: usize, now_ns: u64) {
        while let Some(frame) = self.emulation.outgoing(axis) {
            match self.ports[axis].send(now_ns, frame) {
                Ok(()) => self.counters.sent += 1,
                // The frame is lost, as in a real node; the master detects the loss.
                Err(_) => self.counters.refused += 1,
            }
        }
    }
}
