//! The virtual link: simulated wires, the six drives on them, and the mechanism the drives move,
//! co-simulated event by event in the order of time.
//!
//! Port 0 of every wire is the master's. On the robot a real interface takes this place; the master
//! sees [`Buses`] either way.

use masseter_shared::can::canopen::Cob;
use masseter_shared::can::{Bus, CanId, Frame, ReceiveError, Received, VirtualWire};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::{Truth, pose_fields};

use crate::drive::DriveNode;
use crate::mechanism::{Dynamics, DynamicsError};

/// The wires that a master serves.
pub(crate) trait Buses {
    /// The master's port on a wire.
    fn port(&mut self, bus: usize) -> impl Bus;
}

/// The master's port on every wire.
const MASTER_PORT: usize = 0;

/// Where an axis' drive hangs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) bus: usize,
    pub(crate) port: usize,
}

/// Wires, drives and mechanism.
#[derive(Debug)]
pub(crate) struct VirtualLink {
    wires: Vec<VirtualWire>,
    drives: Vec<DriveNode>,
    places: [Place; AXES],
    dynamics: Dynamics,
    step_ns: u64,
    next_step_ns: u64,
    moved_to_ns: u64,
    force_n: [f64; AXES],
    truth: Truth,
}

impl Buses for VirtualLink {
    fn port(&mut self, bus: usize) -> impl Bus {
        self.wires[bus].port(MASTER_PORT)
    }
}

impl VirtualLink {
    /// Everything at rest at `now_ns`; `drives` in the order of the axes.
    pub(crate) fn new(
        wires: Vec<VirtualWire>,
        drives: Vec<DriveNode>,
        places: [Place; AXES],
        dynamics: Dynamics,
        step_ns: u64,
        now_ns: u64,
    ) -> Self {
        let mut link = Self {
            wires,
            drives,
            places,
            dynamics,
            step_ns,
            next_step_ns: now_ns,
            moved_to_ns: now_ns,
            force_n: [0.0; AXES],
            truth: Truth::default(),
        };
        link.sample_truth(now_ns);
        link
    }

    /// The next frame that a tap on a wire saw up to `now_ns`.
    pub(crate) fn tap(&mut self, bus: usize, now_ns: u64) -> Result<Option<Received>, ReceiveError> {
        self.wires[bus].tap(now_ns)
    }

    /// The mechanism at the last SYNC.
    pub(crate) fn truth(&self) -> Truth {
        self.truth
    }

    /// The drives, in the order of the axes.
    #[cfg(test)]
    pub(crate) fn drives(&self) -> &[DriveNode] {
        &self.drives
    }

    /// Lets everything happen that happens up to `until_ns`.
    pub(crate) fn advance(&mut self, until_ns: u64) -> Result<(), DynamicsError> {
        loop {
            let arrival = self.next_arrival();
            let (time_ns, bus) = match arrival {
                Some((time_ns, bus)) if time_ns <= self.next_step_ns => (time_ns, Some(bus)),
                _ => (self.next_step_ns, None),
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

    /// The next frame to arrive on any wire.
    fn next_arrival(&self) -> Option<(u64, usize)> {
        let arrivals = self.wires.iter().enumerate();
        arrivals.filter_map(|(bus, wire)| Some((wire.next_event_ns()?, bus))).min()
    }

    /// A frame arrives: the drives on the wire take it where their axes stand at that instant.
    fn arrive(&mut self, bus: usize, now_ns: u64) -> Result<(), DynamicsError> {
        self.wires[bus].advance(now_ns);
        for axis in 0..AXES {
            let Place { bus: own_bus, port } = self.places[axis];
            if own_bus != bus {
                continue;
            }
            // An overrun drops the drive's oldest frames, as in a real node; the next ones follow.
            while let Ok(Some(received)) = self.wires[bus].receive(port, now_ns) {
                self.deliver(axis, &received.frame, now_ns)?;
            }
            self.send_outgoing(axis, now_ns);
        }
        Ok(())
    }

    /// Hands a frame to a drive. Only SYNC asks where the mechanism is at this very instant.
    fn deliver(&mut self, axis: usize, frame: &Frame, now_ns: u64) -> Result<(), DynamicsError> {
        if frame.id() == CanId::from(Cob::Sync) {
            self.move_mechanism(now_ns)?;
            if axis == 0 {
                self.sample_truth(now_ns);
            }
        }
        self.drives[axis].receive(now_ns, frame, self.dynamics.positions_m()[axis]);
        Ok(())
    }

    fn step_drives(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        self.move_mechanism(now_ns)?;
        let positions_m = self.dynamics.positions_m();
        for (axis, position_m) in positions_m.into_iter().enumerate() {
            self.force_n[axis] = self.drives[axis].step(now_ns, position_m);
            self.send_outgoing(axis, now_ns);
        }
        self.next_step_ns += self.step_ns;
        Ok(())
    }

    /// Integrates under the forces of the last step.
    fn move_mechanism(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        if now_ns > self.moved_to_ns {
            self.dynamics.step(&self.force_n, (now_ns - self.moved_to_ns) as f64 * 1e-9)?;
            self.moved_to_ns = now_ns;
        }
        Ok(())
    }

    fn send_outgoing(&mut self, axis: usize, now_ns: u64) {
        let Place { bus, port } = self.places[axis];
        while let Some(frame) = self.drives[axis].outgoing() {
            // A full transmit queue loses the frame, as in a real node; the master misses it.
            let _ = self.wires[bus].send(port, now_ns, frame);
        }
    }

    fn sample_truth(&mut self, now_ns: u64) {
        let (position_m, quaternion_wxyz) = pose_fields(self.dynamics.pose());
        self.truth = Truth {
            sampled_ns: now_ns,
            position_m,
            quaternion_wxyz,
            joint_m: self.dynamics.positions_m(),
            joint_m_s: self.dynamics.velocities_m_s(),
            force_n: self.force_n,
            ..Truth::default()
        };
    }
}
