//! The six drives and the mechanism they move, stepped by whoever carries their frames: simulated wires
//! ([`link`](crate::link)) or real ones ([`emulator`](crate::emulator)).

use masseter_can::canopen::Cob;
use masseter_can::{CanId, ErrorState, Frame};
use masseter_shared::geometry::AXES;
use masseter_shared::messages::{Truth, pose_fields};

use crate::drive::DriveNode;
use crate::dynamics::{Dynamics, DynamicsError, State};

/// Drives and mechanism, co-simulated in the order of time.
#[derive(Debug)]
pub(crate) struct Emulation {
    drives: Vec<DriveNode>,
    dynamics: Dynamics,
    step_ns: u64,
    next_step_ns: u64,
    moved_to_ns: u64,
    force_n: [f64; AXES],
    sample: Sample,
    /// Drives that had the SYNC for which it was taken.
    synchronised: [bool; AXES],
}

/// What the truth of a cycle is worked out from, once the reading is on its way.
#[derive(Debug, Clone, Copy)]
struct Sample {
    time_ns: u64,
    state: State,
    force_n: [f64; AXES],
    bite_force_n: f64,
}

impl Sample {
    fn of(dynamics: &Dynamics, force_n: [f64; AXES], time_ns: u64) -> Self {
        Self { time_ns, state: *dynamics.state(), force_n, bite_force_n: dynamics.bite_force_n() }
    }
}

impl Emulation {
    /// Everything at rest at `now_ns`; `drives` in the order of the axes.
    pub(crate) fn new(drives: Vec<DriveNode>, dynamics: Dynamics, step_ns: u64, now_ns: u64) -> Self {
        let force_n = [0.0; AXES];
        Self {
            sample: Sample::of(&dynamics, force_n, now_ns),
            drives,
            dynamics,
            step_ns,
            // Half a step beside the SYNCs of a cycle that is a multiple of it, which have enough to do.
            next_step_ns: now_ns + step_ns / 2,
            moved_to_ns: now_ns,
            force_n,
            synchronised: [true; AXES],
        }
    }

    /// The mechanism at the last SYNC.
    pub(crate) fn truth(&self) -> Truth {
        let Sample { time_ns, state, force_n, bite_force_n } = self.sample;
        let (position_m, quaternion_wxyz) = pose_fields(&state.pose);
        Truth {
            sampled_ns: time_ns,
            position_m,
            quaternion_wxyz,
            joint_m: state.positions_m(),
            joint_m_s: self.dynamics.velocities_m_s(&state),
            force_n,
            bite_force_n,
            ..Truth::default()
        }
    }

    /// The drives, in the order of the axes.
    #[cfg(test)]
    pub(crate) fn drives(&self) -> &[DriveNode] {
        &self.drives
    }

    /// When the drives' loops are due next.
    pub(crate) fn next_step_ns(&self) -> u64 {
        self.next_step_ns
    }

    /// How far the mechanism has been moved.
    pub(crate) fn moved_to_ns(&self) -> u64 {
        self.moved_to_ns
    }

    /// Hands a frame to a drive. Only SYNC asks where the mechanism is at this very instant.
    pub(crate) fn deliver(&mut self, axis: usize, frame: &Frame, now_ns: u64) -> Result<(), DynamicsError> {
        if frame.id() == CanId::from(Cob::Sync) {
            self.move_mechanism(now_ns)?;
            self.synchronise(axis, now_ns);
        }
        self.drives[axis].receive(now_ns, frame, self.dynamics.state().positions_m()[axis]);
        Ok(())
    }

    /// A drive's CAN controller is in that error state.
    pub(crate) fn watch_bus(&mut self, axis: usize, state: ErrorState) {
        self.drives[axis].watch_bus(self.next_step_ns, state);
    }

    /// One step of every drive's loops, where the axes stand at the instant it is due.
    pub(crate) fn step(&mut self) -> Result<(), DynamicsError> {
        let now_ns = self.next_step_ns;
        self.move_mechanism(now_ns)?;
        let positions_m = self.dynamics.state().positions_m();
        for (axis, position_m) in positions_m.into_iter().enumerate() {
            self.force_n[axis] = self.drives[axis].step(now_ns, position_m);
        }
        self.dynamics.push(&self.force_n)?;
        self.next_step_ns += self.step_ns;
        Ok(())
    }

    /// Leaves out the steps due before `now_ns`: the mechanism stands still meanwhile. How much was left
    /// out, ns.
    pub(crate) fn skip_to(&mut self, now_ns: u64) -> u64 {
        let steps = now_ns.saturating_sub(self.next_step_ns) / self.step_ns;
        let skipped_ns = steps * self.step_ns;
        self.next_step_ns += skipped_ns;
        self.moved_to_ns += skipped_ns;
        skipped_ns
    }

    /// The next frame a drive wants to send.
    pub(crate) fn outgoing(&mut self, axis: usize) -> Option<Frame> {
        self.drives[axis].outgoing()
    }

    /// Under the forces of the last step.
    fn move_mechanism(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        if now_ns > self.moved_to_ns {
            self.dynamics.advance((now_ns - self.moved_to_ns) as f64 * 1e-9)?;
            self.moved_to_ns = now_ns;
        }
        Ok(())
    }

    /// Takes the sample with the first SYNC of a cycle, on whichever wire it arrives: one that a drive has
    /// for the second time is a new one, while those that arrive later on busier wires are not.
    fn synchronise(&mut self, axis: usize, now_ns: u64) {
        if self.synchronised[axis] {
            self.synchronised = [false; AXES];
            self.sample = Sample::of(&self.dynamics, self.force_n, now_ns);
        }
        self.synchronised[axis] = true;
    }
}

#[cfg(test)]
mod tests {
    use masseter_can::canopen::sync;
    use masseter_shared::config::Scenario;

    use crate::build::build_emulation;

    #[test]
    fn truth_is_sampled_with_the_first_sync_of_a_cycle_on_whichever_wire() {
        let mut emulation = build_emulation(&Scenario::default(), 0).unwrap();
        let mut sampled_ns = |axes: [usize; 3], at_ns: u64| {
            for axis in axes {
                emulation.deliver(axis, &sync::frame(), at_ns).unwrap();
            }
            emulation.truth().sampled_ns
        };
        let (first, second) = ([0, 1, 2], [3, 4, 5]);
        assert_eq!(sampled_ns(first, 1000), 1000);
        assert_eq!(sampled_ns(second, 1000), 1000);
        assert_eq!(sampled_ns(second, 2000), 2000, "the first wire is busy");
        assert_eq!(sampled_ns(first, 2300), 2000);
        assert_eq!(sampled_ns(second, 3000), 3000);
        assert_eq!(sampled_ns(second, 4000), 4000, "and does not get through at all");
        assert_eq!(sampled_ns(first, 4500), 4000);
        assert_eq!(sampled_ns(first, 5000), 5000, "the second wire is dead");
    }

    #[test]
    fn time_left_out_is_counted_in_whole_steps_and_moves_nothing() {
        let scenario = Scenario::default();
        let step_ns = scenario.dynamics.step_ns;
        let mut emulation = build_emulation(&scenario, 0).unwrap();
        let first_ns = emulation.next_step_ns();
        (0..10).for_each(|_| emulation.step().unwrap());
        let (moved_to_ns, positions_m) = (emulation.moved_to_ns(), emulation.dynamics.state().positions_m());

        assert_eq!(emulation.skip_to(emulation.next_step_ns() + 3 * step_ns + 1), 3 * step_ns);
        assert_eq!(emulation.next_step_ns(), first_ns + 13 * step_ns);
        assert_eq!(emulation.moved_to_ns(), moved_to_ns + 3 * step_ns);
        assert!(emulation.dynamics.state().positions_m().iter().eq(&positions_m));
        assert_eq!(emulation.skip_to(0), 0);
    }
}
