//! The emulated robot: six drives, their mechanism, and their wires.
//!
//! [`Emulation`] co-simulates drives and mechanism, without wires. Simulated wires step it with a master (the plant's
//! default link) or without one ([`OpenLink`]); [`Emulator`] steps it on real interfaces. This module turns a
//! scenario's declarations into plain values, and the active entries of its agenda into effects.

mod agenda;
mod drives;
mod emulator;
mod encoder;
pub(crate) mod jaw;
mod load_cell;
#[cfg(test)]
mod overlap_tests;
mod push;
#[cfg(test)]
mod tests;
pub(crate) mod virtual_link;

use std::ops::Range;

use masseter_can::{CanId, ErrorState, Frame, canopen::Cob};
use masseter_drives::{DriveFault, DriveNode, DriveSettings, HeldMean};
use masseter_model::dynamics::Energy;
use masseter_model::geometry::{AXES, Mechanism};
use masseter_runtime::messages::codes::{Cause, EventKind, Source};
use masseter_runtime::messages::{Contact, Event, Truth, WORKS, pose_fields};
use masseter_scenario::{self as scenario, AxisFault, FaultKindConfig, Scenario};

use crate::error::{DynamicsError, PlantError};
use crate::simulator::mechanism::contact::food::{Food, FoodBreak};
use crate::simulator::mechanism::dynamics::{Dynamics, MechanismState, level};
use agenda::{Agenda, Effect};
use drives::MemoryFile;
use encoder::Encoder;
use load_cell::LoadCell;

pub use drives::drive_settings;
pub use emulator::{Emulator, EmulatorCounters};
pub use virtual_link::{NodePort, OpenLink, VirtualLink};

/// The six drives and the mechanism that they move.
///
/// The carrier of the frames calls [`step`](Self::step) and [`deliver`](Self::deliver) in the order of time, and
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
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Emulation {
    /// In the order of the axes.
    pub(crate) drives: Vec<DriveNode>,
    dynamics: Dynamics,
    step_ns: u64,
    /// Next due time of the drives' servo loops, ns.
    next_step_ns: u64,
    /// The time up to which the mechanism has moved, ns.
    moved_to_ns: u64,
    force_n: [HeldMean; AXES],
    bite_force_n: HeldMean,
    load_cell: Option<LoadCell>,
    sample: Sample,
    /// Whether each drive has received the SYNC of the sample.
    synchronised: [bool; AXES],
    pub(crate) agenda: Agenda,
    encoders: [Encoder; AXES],
    /// The scenario's own food.
    food: Option<Food>,
    /// The beginning of the stimulus whose food is served in place of the scenario's own.
    served: Option<u64>,
    /// The last mishap of each axis, and that of the food.
    mishaps: [Option<Event>; AXES + 1],
    /// The forces between the jaws in the cycle before the sample; `None` if the jaws cannot touch.
    contact: Option<Contact>,
    /// None for drives that forget everything at the end.
    memory: Option<MemoryFile>,
}

/// State of the mechanism at a SYNC. The computation of the truth comes later, after the reading.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Sample {
    time_ns: u64,
    state: MechanismState,
    /// The actuators' forces: means since the last sample, and present values.
    force_n: [[f64; AXES]; 2],
    /// The bite force: mean since the last sample, and present value.
    bite_force_n: [f64; 2],
    /// Value of the load cell; 0 without one.
    load_cell_n: f64,
    /// The ledger of energy.
    work_j: [f64; WORKS],
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
        let food = scenario.food.as_ref().map(|config| jaw::food(config, scenario));
        let closed = level(&mechanism, scenario.jaw.closed_leg_m, scenario.jaw.closed_offset_m);
        let occlusion = jaw::occlusion(scenario, &closed);
        let start = level(&mechanism, scenario.dynamics.initial_leg_m, scenario.dynamics.initial_offset_m);
        let agenda = Agenda::new(scenario, now_ns)?;
        let incisal_m = scenario.jaw.reference_point_m;
        let dynamics = Dynamics::new(mechanism, &scenario.dynamics, start, occlusion, incisal_m)?;
        let positions_m = dynamics.state.positions_m();
        let drive = |(axis, settings): (usize, &DriveSettings)| {
            let drive = DriveNode::new(settings, now_ns, positions_m[axis]);
            drive.map_err(|reason| match &memory {
                Some(memory) => memory.refuse(axis, &reason),
                None => reason.into(),
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
                work_j: [0.0; WORKS],
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
            encoders: Encoder::of_axes(scenario),
            food,
            served: None,
            mishaps: [None; AXES + 1],
            contact: scenario.has_contact().then(Contact::default),
            memory,
        })
    }

    /// Writes the drives' changed stored values into the scenario's file (`drives.memory`). A write takes the time of a
    /// file, so a loop in real time calls this function at its end.
    ///
    /// # Errors
    /// [`PlantError::Memory`] for a file that cannot be written.
    pub fn save_memory(&mut self) -> Result<(), PlantError> {
        self.memory.as_mut().map_or(Ok(()), |memory| memory.save(&mut self.drives))
    }

    /// The mechanism's motion at the last SYNC.
    pub fn truth(&self) -> Truth {
        let Sample { time_ns, state, force_n, bite_force_n, work_j, .. } = self.sample;
        let (joint_m_s, Energy { kinetic_j, potential_j }) = self.dynamics.motion_and_energy(&state);
        let (position_m, quaternion_wxyz) = pose_fields(&state.pose);
        Truth {
            sampled_ns: time_ns,
            position_m,
            quaternion_wxyz,
            joint_m: state.positions_m(),
            joint_m_s,
            force_n: force_n[0],
            force_sample_n: force_n[1],
            bite_force_n: bite_force_n[0],
            bite_force_sample_n: bite_force_n[1],
            work_j,
            kinetic_j,
            potential_j,
            ..Truth::default()
        }
    }

    fn note_mishaps(&mut self, now_ns: u64) {
        let notice = |cause| {
            let event = Event::new(Source::Scenario, EventKind::Notice, cause);
            Event { time_ns: now_ns, ..event }
        };
        while let Some((axis, speed_m_s)) = self.dynamics.axes.take_stop_hit() {
            let hit = Event { axis: axis as u32, value: speed_m_s, ..notice(Cause::EndStopHit) };
            self.mishaps[axis] = Some(hit);
        }
        if let Some(FoodBreak { tooth, force_n, strength_n }) = self.dynamics.occlusion.broke.take() {
            let (object, value, limit) = (tooth.into(), force_n, strength_n);
            self.mishaps[AXES] = Some(Event { object, value, limit, ..notice(Cause::FoodBroke) });
        }
    }

    /// Delivers a frame to a drive. Only a SYNC moves the mechanism to this very instant, for the drive's sample.
    pub fn deliver(&mut self, axis: usize, frame: &Frame, now_ns: u64) -> Result<(), DynamicsError> {
        if frame.id() != CanId::from(Cob::Sync) {
            self.drives[axis].receive(now_ns, frame);
            return Ok(());
        }
        self.move_mechanism(now_ns)?;
        self.follow_agenda(now_ns);
        self.synchronise(axis, now_ns);
        let (position_m, encoder) = (self.dynamics.drive_positions_m()[axis], &mut self.encoders[axis]);
        self.drives[axis].take_sync(now_ns, frame, position_m, |at_m| encoder.look(now_ns, at_m));
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
        let joints_m = self.dynamics.state.positions_m();
        for (axis, position_m) in positions_m.into_iter().enumerate() {
            let encoder = &mut self.encoders[axis];
            let force_n = self.drives[axis].step(now_ns, position_m, |at_m| encoder.look(now_ns, at_m));
            self.force_n[axis].hold(force_n, now_ns);
            self.drives[axis].compare_encoders(now_ns, joints_m[axis]);
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

    /// Begins and ends the scenario's due entries for drives and mechanism.
    #[inline]
    fn follow_agenda(&mut self, now_ns: u64) {
        while let Some(place) = self.agenda.next_change(now_ns, || self.dynamics.state.positions_m()) {
            self.follow_entry(place);
        }
    }

    /// Handles the beginning or the end of the entry at that place: the effects follow from the active entries.
    fn follow_entry(&mut self, place: usize) {
        match *self.agenda.effect(place) {
            Effect::Fault { kind, axis, .. } => axes_of(axis).for_each(|axis| match kind {
                FaultKindConfig::Encoder(_) => {
                    self.encoders[axis].set(self.agenda.number(place), self.agenda.begun(place));
                }
                FaultKindConfig::Drive(of_drive) => {
                    self.drives[axis].set_fault(drive_fault(of_drive), self.agenda.size(kind, axis));
                }
                FaultKindConfig::Axis(_) => self.dynamics.set_faults(axis, self.agenda.axis_faults(axis)),
                // None of these is an effect on an axis.
                FaultKindConfig::Platform(_)
                | FaultKindConfig::Bus(_)
                | FaultKindConfig::Command(_)
                | FaultKindConfig::Process(_) => {}
            }),
            Effect::Payload { .. } => self.dynamics.load.payload_kg = self.agenda.payload_kg(),
            Effect::Food(_) => {
                let food = self.agenda.food();
                let served = food.map(|(begun, _)| begun);
                if std::mem::replace(&mut self.served, served) != served {
                    let food = food.map(|(_, food)| food.clone());
                    self.dynamics.occlusion.set_food(food.or_else(|| self.food.clone()));
                }
            }
            // Its force is asked for at every step.
            Effect::Push(_) => {}
        }
    }

    /// Whether the fault at that place of the agenda has changed something itself.
    fn has_struck(&self, place: usize) -> bool {
        let Effect::Fault { kind, size, axis } = *self.agenda.effect(place) else { return false };
        axes_of(axis).any(|axis| match kind {
            FaultKindConfig::Encoder(_) => self.encoders[axis].has_struck(self.agenda.number(place)),
            FaultKindConfig::Drive(of_drive) => {
                self.drives[axis].faults().has_struck(drive_fault(of_drive)) && self.agenda.acts(place, axis)
            }
            FaultKindConfig::Axis(AxisFault::EndStop) => {
                let (touched, own) =
                    (self.dynamics.axes.each[axis].touched, self.agenda.nearest_stops(place, axis));
                touched.iter().zip(own).any(|(touched, is_own)| *touched && is_own)
            }
            FaultKindConfig::Axis(AxisFault::Friction) => {
                size.to_bits() != 1.0_f64.to_bits() && self.agenda.acts(place, axis)
            }
            FaultKindConfig::Axis(AxisFault::Jam | AxisFault::Play | AxisFault::BrokenRod) => {
                self.agenda.acts(place, axis)
            }
            FaultKindConfig::Platform(_)
            | FaultKindConfig::Bus(_)
            | FaultKindConfig::Command(_)
            | FaultKindConfig::Process(_) => false,
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
                work_j: self.dynamics.ledger.work_j,
            };
            if let Some(contact) = &mut self.contact {
                *contact = Contact { sampled_ns: now_ns, ..self.dynamics.occlusion.take_mean() };
            }
        }
        self.synchronised[axis] = true;
    }
}

/// The drive's name of a scenario's fault.
fn drive_fault(kind: scenario::DriveFault) -> DriveFault {
    use scenario::DriveFault as Of;
    match kind {
        Of::Fault => DriveFault::Fault,
        Of::IgnoresTargets => DriveFault::IgnoresTargets,
        Of::TorqueLoss => DriveFault::TorqueLoss,
        Of::Runaway => DriveFault::Runaway,
        Of::Sto => DriveFault::Sto,
        Of::SlowEnable => DriveFault::SlowEnable,
        Of::BrakeOpen => DriveFault::BrakeOpen,
        Of::BrakeClosed => DriveFault::BrakeClosed,
        Of::Reboot => DriveFault::Reboot,
        Of::Scale => DriveFault::Scale,
        Of::EmcyStorm => DriveFault::EmcyStorm,
    }
}

/// The axis, or all of them.
fn axes_of(axis: Option<usize>) -> Range<usize> {
    axis.map_or(0..AXES, |axis| axis..axis + 1)
}
