//! The emulated robot: six drives, the mechanism that they move, and the wires they are on.
//!
//! [`Emulation`] co-simulates drives and mechanism, without wires. Simulated wires step it with a master
//! (the plant's default link) or without one ([`OpenLink`]); [`Emulator`] steps it on real interfaces.

pub(crate) mod drives;
mod emulator;
#[cfg(test)]
mod tests;
pub(crate) mod virtual_link;

use std::ops::Range;

use masseter_can::canopen::Cob;
use masseter_can::{CanId, ErrorState, Frame};
use masseter_model::geometry::{AXES, Mechanism};
use masseter_runtime::messages::{Contact, Truth, pose_fields};
use masseter_scenario::{LoadCellConfig, Scenario};
use nalgebra::Translation3;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::error::{DynamicsError, PlantError};
use crate::master::link::Mishap;
use crate::simulator::drive::DriveSettings;
use crate::simulator::drive::axis::drivetrain::HeldMean;
use crate::simulator::drive::axis::encoder::Encoder;
use crate::simulator::drive::axis::motion::Shaft;
use crate::simulator::drive::node::DriveNode;
use crate::simulator::injection::agenda::{Agenda, Change, Effect, PartFault};
use crate::simulator::injection::encoder_faults::EncoderFaults;
use crate::simulator::mechanism::contact::Occlusion;
use crate::simulator::mechanism::contact::food::{Food, FoodBreak};
use crate::simulator::mechanism::dynamics::{Dynamics, MechanismState, closed_mouth, level};
use crate::state::state;
use drives::{MemoryFile, drive_settings};

pub use emulator::{Emulator, EmulatorCounters};
pub use virtual_link::{NodePort, OpenLink, VirtualLink};

/// The six drives and the mechanism that they move.
///
/// Whoever carries the frames calls [`step`](Self::step) and [`deliver`](Self::deliver) in the order of time, and
/// [`outgoing`](Self::outgoing) after each.
///
/// ```
/// use masseter_plant::emulation::Emulation;
/// use masseter_can::canopen::{Cob, NodeId};
/// use masseter_scenario::Scenario;
///
/// let mut emulation = Emulation::new(&Scenario::default(), 0)?;
/// let boot_up = loop {
///     emulation.step()?;
///     if let Some(frame) = emulation.outgoing(0) {
///         break frame;
///     }
/// };
/// assert_eq!(Cob::try_from(boot_up.id())?, Cob::Heartbeat(NodeId::new(1)?));
/// # Ok::<_, Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Emulation {
    /// In the order of the axes.
    pub(crate) drives: Vec<DriveNode>,
    dynamics: Dynamics,
    step_ns: u64,
    /// When the drives' servo loops are due next, ns.
    next_step_ns: u64,
    /// The time up to which the mechanism has moved, ns.
    moved_to_ns: u64,
    force_n: [HeldMean; AXES],
    bite_force_n: HeldMean,
    load_cell: Option<LoadCell>,
    sample: Sample,
    /// Whether each drive has received the SYNC of the sample.
    synchronised: [bool; AXES],
    agenda: Agenda,
    encoder_faults: [EncoderFaults; AXES],
    /// The scenario's own food.
    food: Option<Food>,
    /// One of each axis, and one of the food, with its time, ns.
    mishaps: [Option<(u64, Mishap)>; AXES + 1],
    /// The forces between the jaws in the cycle before the sample; none where the jaws cannot touch.
    contact: Option<Contact>,
    /// None for drives that forget everything at the end.
    memory: Option<MemoryFile>,
}

state!(Emulation {
    values: next_step_ns moved_to_ns force_n bite_force_n sample synchronised encoder_faults mishaps
        contact;
    parts: drives dynamics load_cell agenda memory;
    constant: step_ns food;
});

/// State of the mechanism at a SYNC. The truth is computed from it later, once the reading is on its way.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Sample {
    time_ns: u64,
    state: MechanismState,
    /// The actuators' forces: means since the last sample, and present values.
    force_n: [[f64; AXES]; 2],
    /// The bite force: mean since the last sample, and present value.
    bite_force_n: [f64; 2],
    /// What the load cell shows; 0 without one.
    load_cell_n: f64,
}

impl Emulation {
    /// The scenario's drives and mechanism, at rest and switched on at `now_ns`.
    ///
    /// # Errors
    /// [`PlantError`] where the scenario describes no mechanism or no drives.
    pub fn new(scenario: &Scenario, now_ns: u64) -> Result<Self, PlantError> {
        let mut settings = drive_settings(scenario)?;
        let memory = scenario.drives.memory.as_deref().map(MemoryFile::read).transpose()?;
        if let Some(memory) = &memory {
            for (axis, settings) in settings.iter_mut().enumerate() {
                settings.memory = memory.drives[axis].clone();
            }
        }
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let food = scenario.food.as_ref().map(|config| Food::new(config, &scenario.arch()));
        let occlusion = Occlusion::new(scenario, &closed_mouth(&mechanism, &scenario.jaw));
        let start = Translation3::from(scenario.dynamics.initial_offset_m)
            * level(&mechanism, scenario.dynamics.initial_leg_m);
        let agenda = Agenda::new(scenario, now_ns)?;
        let incisal_m = scenario.jaw.reference_point_m;
        let dynamics = Dynamics::new(mechanism, &scenario.dynamics, start, occlusion, incisal_m)?;
        let positions_m = dynamics.state.positions_m();
        let drive = |(axis, settings): (usize, &DriveSettings)| {
            let config = &settings.drive;
            let encoder =
                Encoder::new(config.encoder_resolution_m, config.encoder_noise_m, scenario.seed, axis);
            let drive = DriveNode::new(settings, encoder, now_ns, positions_m[axis]);
            drive.map_err(|reason| match &memory {
                Some(memory) => memory.refuse(axis, &reason),
                None => PlantError::Scenario(reason),
            })
        };
        let step_ns = scenario.dynamics.step_ns;
        let state = dynamics.state;
        Ok(Self {
            drives: settings.iter().enumerate().map(drive).collect::<Result<_, _>>()?,
            sample: Sample {
                time_ns: now_ns,
                state,
                force_n: [[0.0; AXES]; 2],
                bite_force_n: [0.0; 2],
                load_cell_n: 0.0,
            },
            dynamics,
            step_ns,
            // Half a step beside the SYNCs of a cycle that is a multiple of the step: SYNCs are work enough.
            next_step_ns: now_ns + step_ns / 2,
            moved_to_ns: now_ns,
            force_n: [HeldMean::new(now_ns); AXES],
            bite_force_n: HeldMean::new(now_ns),
            load_cell: scenario.load_cell.map(|config| LoadCell::new(config, scenario.seed)),
            synchronised: [true; AXES],
            agenda,
            encoder_faults: EncoderFaults::of_axes(scenario),
            food,
            mishaps: [None; AXES + 1],
            contact: scenario.has_contact().then(Contact::default),
            memory,
        })
    }

    /// Writes what the drives have stored into the scenario's file (`drives.memory`), if that has changed. This takes
    /// the time of a file: a loop in real time calls it at its end.
    ///
    /// # Errors
    /// [`PlantError::Memory`] for a file that cannot be written.
    pub fn save_memory(&mut self) -> Result<(), PlantError> {
        let Some(memory) = &mut self.memory else { return Ok(()) };
        for (axis, drive) in self.drives.iter_mut().enumerate() {
            if let Some(changed) = drive.changed_memory() {
                memory.set_of_axis(axis, changed);
            }
        }
        memory.write_if_stale()
    }

    /// The mechanism's motion at the last SYNC.
    pub fn truth(&self) -> Truth {
        let Sample { time_ns, state, force_n, bite_force_n, .. } = self.sample;
        let (position_m, quaternion_wxyz) = pose_fields(&state.pose);
        Truth {
            sampled_ns: time_ns,
            position_m,
            quaternion_wxyz,
            joint_m: state.positions_m(),
            joint_m_s: self.dynamics.velocities_m_s(&state),
            force_n: force_n[0],
            force_sample_n: force_n[1],
            bite_force_n: bite_force_n[0],
            bite_force_sample_n: bite_force_n[1],
            ..Truth::default()
        }
    }

    /// The next mishap of the mechanism, with its time, ns.
    pub(crate) fn next_mishap(&mut self) -> Option<(u64, Mishap)> {
        self.mishaps.iter_mut().find_map(Option::take)
    }

    fn note_mishaps(&mut self, now_ns: u64) {
        while let Some((axis, speed_m_s)) = self.dynamics.axes.take_stop_hit() {
            self.mishaps[axis] = Some((now_ns, Mishap::EndStopHit { axis, speed_m_s }));
        }
        if let Some(FoodBreak { tooth, force_n, strength_n }) = self.dynamics.occlusion.broke.take() {
            self.mishaps[AXES] = Some((now_ns, Mishap::FoodBroke { tooth, force_n, strength_n }));
        }
    }

    /// Delivers a frame to a drive. Only a SYNC moves the mechanism to this very instant, and makes the drive look at it.
    pub fn deliver(&mut self, axis: usize, frame: &Frame, now_ns: u64) -> Result<(), DynamicsError> {
        if frame.id() != CanId::from(Cob::Sync) {
            self.drives[axis].receive(now_ns, frame);
            return Ok(());
        }
        self.move_mechanism(now_ns)?;
        self.follow_agenda(now_ns);
        self.synchronise(axis, now_ns);
        let seen_m = self.encoder_faults[axis].seen_m(now_ns, self.dynamics.drive_positions_m()[axis]);
        self.drives[axis].take_sync(now_ns, frame, seen_m);
        Ok(())
    }

    /// Reports the error state of a drive's CAN controller to the drive.
    pub fn set_error_state(&mut self, axis: usize, state: ErrorState) {
        self.drives[axis].set_error_state(self.next_step_ns, state);
    }

    /// One step of every drive's servo loops, at the instant when it is due.
    pub fn step(&mut self) -> Result<(), DynamicsError> {
        let now_ns = self.next_step_ns;
        self.move_mechanism(now_ns)?;
        self.follow_agenda(now_ns);
        let positions_m = self.dynamics.drive_positions_m();
        for (axis, is_m) in positions_m.into_iter().enumerate() {
            let seen_m = self.encoder_faults[axis].seen_m(now_ns, is_m);
            let force_n = self.drives[axis].step(now_ns, Shaft { seen_m, is_m });
            self.force_n[axis].hold(force_n, now_ns);
        }
        if self.agenda.is_empty() {
            self.push()?;
        } else {
            self.push_injected(now_ns)?;
        }
        if let Some(cell) = &mut self.load_cell {
            cell.follow(self.bite_force_n.value, self.step_ns as f64 * 1e-9);
        }
        self.bite_force_n.hold(self.dynamics.occlusion.bite_force_n(), now_ns);
        self.note_mishaps(now_ns);
        self.next_step_ns += self.step_ns;
        Ok(())
    }

    /// Pushes the mechanism with the drives' forces.
    fn push(&mut self) -> Result<(), DynamicsError> {
        self.dynamics.push(&self.force_n.map(|force_n| force_n.value))
    }

    /// Pushes the mechanism with the scenario's forces too, and reports the faults that have struck.
    fn push_injected(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        self.dynamics.load.pushed.fill(0.0);
        for (wrench, point_m) in self.agenda.pushes(now_ns) {
            self.dynamics.load(&wrench, point_m);
        }
        self.push()?;
        let mut from = 0;
        while let Some(place) = self.agenda.next_waiting(from) {
            if self.has_struck(place) {
                self.agenda.strike(place, now_ns);
            }
            from = place + 1;
        }
        Ok(())
    }

    /// Begins and ends what the scenario does to drives and mechanism by now.
    #[inline]
    fn follow_agenda(&mut self, now_ns: u64) {
        while let Some(change) = self.agenda.next_change(now_ns) {
            self.carry_out(change);
        }
    }

    fn carry_out(&mut self, Change { place, is_begin }: Change) {
        match *self.agenda.effect(place) {
            Effect::Fault { kind, size, axis } if is_begin => {
                axes_of(axis).for_each(|axis| self.begin_fault(axis, kind, size));
            }
            Effect::Fault { kind, axis, .. } => {
                if !self.agenda.has_another(kind, axis) {
                    axes_of(axis).for_each(|axis| self.end_fault(axis, kind));
                }
            }
            Effect::FaultyPayload { .. } | Effect::Payload { .. } => {
                let payloads_kg = self.agenda.active().filter_map(|effect| match effect {
                    Effect::FaultyPayload { kg } | Effect::Payload { kg } => Some(*kg),
                    _ => None,
                });
                self.dynamics.load.payload_kg = payloads_kg.sum();
            }
            Effect::Food(_) => {
                let served = self.agenda.active().filter_map(|effect| match effect {
                    Effect::Food(food) => Some((**food).clone()),
                    _ => None,
                });
                self.dynamics.occlusion.set_food(served.last().or_else(|| self.food.clone()));
            }
            // Its force is asked for at every step.
            Effect::Push(_) => {}
        }
    }

    fn begin_fault(&mut self, axis: usize, kind: PartFault, size: f64) {
        match kind {
            PartFault::Encoder(kind) => self.encoder_faults[axis].begin(kind, size),
            PartFault::Drive(kind) => self.drives[axis].axis.faults.begin(kind, size),
            PartFault::Axis(kind) => self.dynamics.begin_fault(axis, kind, size),
        }
    }

    fn end_fault(&mut self, axis: usize, kind: PartFault) {
        match kind {
            PartFault::Encoder(kind) => self.encoder_faults[axis].end(kind),
            PartFault::Drive(kind) => self.drives[axis].axis.faults.end(kind),
            PartFault::Axis(kind) => self.dynamics.end_fault(axis, kind),
        }
    }

    /// Whether the fault at that place of the agenda has changed something.
    fn has_struck(&self, place: usize) -> bool {
        let Effect::Fault { kind, axis, .. } = *self.agenda.effect(place) else { return false };
        axes_of(axis).any(|axis| match kind {
            PartFault::Encoder(kind) => self.encoder_faults[axis].has_struck(kind),
            PartFault::Drive(kind) => self.drives[axis].axis.faults.has_struck(kind),
            PartFault::Axis(kind) => self.dynamics.axes.each[axis].acting.has_struck(kind),
        })
    }

    /// Skips the steps due before `now_ns`: the mechanism rests meanwhile. Returns the skipped time, ns.
    pub fn skip_to(&mut self, now_ns: u64) -> u64 {
        let steps = now_ns.saturating_sub(self.next_step_ns) / self.step_ns;
        let skipped_ns = steps * self.step_ns;
        self.next_step_ns += skipped_ns;
        self.moved_to_ns += skipped_ns;
        skipped_ns
    }

    /// The next frame that a drive transmits.
    pub fn outgoing(&mut self, axis: usize) -> Option<Frame> {
        self.drives[axis].outgoing()
    }

    /// Moves the mechanism under the forces of the last step.
    fn move_mechanism(&mut self, now_ns: u64) -> Result<(), DynamicsError> {
        if now_ns > self.moved_to_ns {
            self.dynamics.advance((now_ns - self.moved_to_ns) as f64 * 1e-9)?;
            self.moved_to_ns = now_ns;
        }
        Ok(())
    }

    /// Takes the sample with the first SYNC of a cycle, on whichever wire it arrives. A SYNC that reaches a drive for
    /// the second time begins a new cycle; one that arrives later on a busier wire does not.
    fn synchronise(&mut self, axis: usize, now_ns: u64) {
        if self.synchronised[axis] {
            self.synchronised = [false; AXES];
            self.sample = Sample {
                time_ns: now_ns,
                state: self.dynamics.state,
                force_n: [
                    self.force_n.each_mut().map(|force_n| force_n.take_mean(now_ns)),
                    self.force_n.map(|force_n| force_n.value),
                ],
                bite_force_n: [self.bite_force_n.take_mean(now_ns), self.bite_force_n.value],
                load_cell_n: self.load_cell.as_mut().map_or(0.0, LoadCell::read),
            };
            if let Some(contact) = &mut self.contact {
                *contact = Contact { sampled_ns: now_ns, ..self.dynamics.occlusion.take_mean() };
            }
        }
        self.synchronised[axis] = true;
    }
}

/// The axis, or all of them.
fn axes_of(axis: Option<usize>) -> Range<usize> {
    axis.map_or(0..AXES, |axis| axis..axis + 1)
}

/// Parts the cell's random numbers from those of the encoders, which have odd multiples of another number.
const STREAM: u64 = 0x4C6F_6164_4365_6C6C;

/// The load cell.
#[derive(Debug, Clone)]
struct LoadCell {
    config: LoadCellConfig,
    /// The force behind the low-pass, N.
    passed_n: f64,
    random: Pcg64Mcg,
}

state!(LoadCell {
    values: passed_n random;
    constant: config;
});

impl LoadCell {
    /// Without load so far.
    fn new(config: LoadCellConfig, seed: u64) -> Self {
        Self { config, passed_n: 0.0, random: Pcg64Mcg::seed_from_u64(seed ^ STREAM) }
    }

    /// The bite force was this large (N) for that time (s).
    fn follow(&mut self, force_n: f64, time_s: f64) {
        let left = (-time_s / self.config.time_s()).exp();
        self.passed_n = force_n + (self.passed_n - force_n) * left;
    }

    /// A sample, N.
    fn read(&mut self) -> f64 {
        let LoadCellConfig { noise_n, offset_n, range_n, .. } = self.config;
        let noise: f64 = self.random.sample(StandardNormal);
        (self.passed_n + offset_n + noise_n * noise).clamp(-range_n, range_n)
    }
}

#[cfg(test)]
mod load_cell_tests {
    use super::*;

    const QUIET: LoadCellConfig =
        LoadCellConfig { bandwidth_hz: 100.0, noise_n: 0.0, offset_n: 0.0, range_n: 1000.0 };

    #[test]
    fn a_step_is_shown_behind_a_low_pass_however_finely_the_time_is_cut() {
        let time_s = QUIET.time_s();
        for steps in [1, 10, 1000] {
            let mut cell = LoadCell::new(QUIET, 1);
            (0..steps).for_each(|_| cell.follow(50.0, time_s / f64::from(steps)));
            assert!((cell.read() - 50.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9, "{steps}");
        }
    }

    #[test]
    fn the_cell_shows_its_offset_and_no_more_than_its_range() {
        let config = LoadCellConfig { offset_n: 2.0, range_n: 40.0, ..QUIET };
        for (force_n, shown_n) in [(0.0, 2.0), (30.0, 32.0), (39.0, 40.0), (-100.0, -40.0)] {
            let mut cell = LoadCell::new(config, 1);
            cell.follow(force_n, 1.0);
            assert!((cell.read() - shown_n).abs() < 1e-9, "{force_n}");
        }
    }

    #[test]
    fn noise_has_the_declared_spread_and_comes_from_the_seed() {
        let samples_n = |seed| {
            let mut cell = LoadCell::new(LoadCellConfig { noise_n: 0.5, ..QUIET }, seed);
            std::iter::repeat_with(|| cell.read()).take(20_000).collect::<Vec<f64>>()
        };
        let found_n = samples_n(3);
        let rms_n = (found_n.iter().map(|n| n * n).sum::<f64>() / found_n.len() as f64).sqrt();
        assert!((rms_n - 0.5).abs() < 0.015, "{rms_n}");
        assert_eq!(found_n, samples_n(3));
        assert_ne!(found_n, samples_n(4));
    }
}
