//! Messages between the processes: one fixed-size type for each topic.
//!
//! Every message begins with its sequence number, its publication time and the version of its layout. All times are
//! nanoseconds of `CLOCK_MONOTONIC`, 0 for an event that has not happened. Fields lie on their natural alignment
//! without padding, so the bytes in shared memory are also a valid CDR body. The exception is unused bytes at the end
//! of a field of variable length. The recording writes [`Message::body`] unchanged, with the definition that
//! [`Message::definition`] derives from the same table.
//!
//! The codes of enumerations are in [`codes`]. The transport is in `masseter_runtime::transport`.

pub mod codes;
mod message;
pub mod tap;
mod words;

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable, bytes_of, bytes_of_mut};
use iceoryx2::prelude::ZeroCopySend;

use codes::{Cause, EventKind, NO_AXIS, OF_OPERATOR, Source};
use masseter_model::geometry::{AXES, LEGS, Pose};
use masseter_scenario::MOST_PAIRS;
use message::{FieldType, messages};

pub use message::{CanData, Field, LAYOUT_VERSION, MOST_VALUES, Message, Values, plain};
pub use words::explain;

/// Lowest bits of the significand that are zero in computed figures: 31 bits stay, nine decimal digits.
///
/// A place of 0.3 m keeps steps of 0.2 nm, far below every encoder. Lower bits are rounding errors of formulas. Such
/// bits do not compress: without rounding they are a sixth of a recording (docs/data.md). Commands, readings, times,
/// and the signals of a controller keep every bit.
const ZERO_BITS: u32 = 22;

/// Kinds of forces in [`Truth::work_j`].
pub const WORKS: usize = 6;

messages! {
    /// Targets and request for the drives, once a cycle.
    Command on "command" keeping 2048 as "masseter/Command/58429641477964f3" {
        /// Cycle of the controller, from 1.
        cycle: u64,
        /// Cycle of the reading it was computed from; 0 when there was none.
        reading_cycle: u64,
        /// Desired positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        target_m: [f64; AXES],
        /// Forces that the drives add to those of their position control, positive towards increasing position, N; 0
        /// without feed-forward.
        force_offset_n: [f64; AXES],
        /// Requested drive state, a [`codes::DriveRequest`].
        request: u32,
        /// State of the controller, a [`codes::ControllerState`].
        controller_state: u32,
    }

    /// Positions, forces and states of the drives, once a cycle.
    Reading on "reading" keeping 2048 as "masseter/Reading/a9068e5a70343ba1" {
        /// Cycle of the plant, from 1.
        cycle: u64,
        /// Cycle of the last command received when the sample was taken; 0 before the first.
        answers_cycle: u64,
        /// When SYNC made the drives sample, ns.
        sampled_ns: u64,
        /// When the last process data of the six drives had arrived, ns.
        complete_ns: u64,
        /// When the command named by `answers_cycle` was received, ns.
        command_received_ns: u64,
        /// When the last process data of that command had left onto the wire, ns.
        command_sent_ns: u64,
        /// Deadline of the master's cycle, ns.
        due_ns: u64,
        /// When the master woke for it, ns.
        woke_ns: u64,
        /// Deadlines skipped since start because an earlier cycle overran.
        skipped_cycles: u64,
        /// Time for which the machine stalled while the process waited, since start, ns.
        stalled_ns: u64,
        /// Time that the process spun, without the stalls, since start, ns.
        spun_ns: u64,
        /// Time that the process worked, since start, ns.
        worked_ns: u64,
        /// Part of it in stretches too long for the work alone, ns.
        overlong_ns: u64,
        /// Encoder positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        position_m: [f64; AXES],
        /// Actuator forces as the drives report them, positive towards increasing position, N. An emulated drive reports the
        /// mean since the last SYNC.
        force_n: [f64; AXES],
        /// Bite force that the load cell shows at SYNC, N; 0 without a load cell.
        load_cell_n: f64,
        /// Drive states, [`codes::DriveState`], or [`codes::NO_DRIVE_STATE`].
        drive_state: [u32; AXES],
        /// Axes whose process data arrived this cycle, bit i for axis i.
        fresh_axes: u32,
        /// 1 once the master refuses to move anything, with the cause in an event.
        master_fault: u32,
    }

    /// The controller's state and its estimate, once a cycle. All float64 fields but `motion_time_s` have 31 significant bits.
    State on "state" keeping 2048 as "masseter/State/1880bb659a4ccdc7" {
        /// Cycle of the controller, from 1.
        cycle: u64,
        /// Cycle of the reading it was computed from; 0 when there was none.
        reading_cycle: u64,
        /// When that reading was sampled, ns.
        sampled_ns: u64,
        /// Deadline of the cycle, ns.
        due_ns: u64,
        /// When the loop woke for it, ns.
        woke_ns: u64,
        /// When the reading had been received, ns.
        received_ns: u64,
        /// When the forward kinematics was done, ns.
        solved_ns: u64,
        /// When the command was ready to be published, ns.
        commanded_ns: u64,
        /// Deadlines skipped since start because an earlier cycle overran.
        skipped_cycles: u64,
        /// Time for which the machine stalled while the process waited, since start, ns.
        stalled_ns: u64,
        /// Time that the process spun, without the stalls, since start, ns.
        spun_ns: u64,
        /// Time that the process worked, since start, ns.
        worked_ns: u64,
        /// Part of it in stretches too long for the work alone, ns.
        overlong_ns: u64,
        /// How far the motion had come at the sample, s: of a recorded one, the time since the recording's first row. It
        /// passes more slowly while the motion gathers speed and while it comes to rest. Negative before the motion
        /// begins.
        motion_time_s: f64,
        /// Desired pose at the sample: position in the base frame, m.
        desired_position_m: [f64; 3],
        /// Desired pose at the sample: unit quaternion w x y z.
        desired_quaternion_wxyz: [f64; 4],
        /// Estimated pose by forward kinematics: position in the base frame, m.
        estimated_position_m: [f64; 3],
        /// Estimated pose by forward kinematics: unit quaternion w x y z.
        estimated_quaternion_wxyz: [f64; 4],
        /// θ₁ θ₂ θ₃, rad.
        leg_angle_rad: [f64; LEGS],
        /// Largest difference of a platform side from its length, m.
        residual_m: f64,
        /// Condition number of the actuators' Jacobian, angular columns scaled by the platform's side A₁A₂. The motion
        /// controller computes one every ten cycles and repeats it; 0 where none is computed.
        condition: f64,
        /// Iterations of the forward kinematics.
        iterations: u32,
        /// State of the controller, a [`codes::ControllerState`].
        controller_state: u32,
    }

    /// The signals that the controller declares, once a cycle; without any, there is no such message. A recording's
    /// definition of the message has a field for each signal.
    Signals on "signal" keeping 2048 as "masseter/Signals/51f27d062c32f9d8" {
        /// Cycle of the controller, from 1.
        cycle: u64,
        /// The signals, in the order of their declaration.
        signals: Values,
    }

    /// The parameters that the controller declares, in its first cycle and in each that begins with another value. A
    /// recording's definition of the message has a field for each parameter.
    Parameters on "parameter" keeping 256 as "masseter/Parameters/f30e6d2f8ce938b6" {
        /// Cycle of the controller, from 1.
        cycle: u64,
        /// The parameters, in the order of their declaration.
        parameters: Values,
    }

    /// The true state of the mechanism, once a cycle; the controller never reads it. All float64 fields have 31
    /// significant bits.
    Truth on "truth" keeping 2048 as "masseter/Truth/aaa6b46fe5150f32" {
        /// Cycle of the plant, from 1.
        cycle: u64,
        /// The instant it describes: that of the reading's sample, ns.
        sampled_ns: u64,
        /// Platform origin in the base frame, m.
        position_m: [f64; 3],
        /// Platform orientation, unit quaternion w x y z.
        quaternion_wxyz: [f64; 4],
        /// Joint positions d₁ d₂ d₃ l₁ l₂ l₃, m.
        joint_m: [f64; AXES],
        /// Joint velocities, m/s.
        joint_m_s: [f64; AXES],
        /// Actuator forces, N: means over the cycle before the sample.
        force_n: [f64; AXES],
        /// Actuator forces at the sample, N.
        force_sample_n: [f64; AXES],
        /// Vertical force of food and upper teeth on the lower jaw, positive downwards, N: mean over the cycle before the sample.
        bite_force_n: f64,
        /// Bite force at the sample, N.
        bite_force_sample_n: f64,
        /// Work on the bodies since the start, J: of the drives, of friction in slides, legs, and hinges with balls, of teeth and
        /// food, of everything else (pushes, payload, end stops).
        work_j: [f64; WORKS],
        /// Energy of the bodies' motion, J.
        kinetic_j: f64,
        /// Energy of their height above that of the start, J.
        potential_j: f64,
    }

    /// The forces between the jaws, once a cycle; without teeth and food, there is no such message. The controller never reads
    /// it. All float64 fields have 31 significant bits.
    Contact on "contact" keeping 2048 as "masseter/Contact/aa4988fe35a2196c" {
        /// Cycle of the plant, from 1.
        cycle: u64,
        /// End of the time that it describes: the instant of the reading's sample, ns.
        sampled_ns: u64,
        /// FDI numbers of the lower teeth, 0 where there are no more.
        tooth: [u32; MOST_PAIRS],
        /// Force of antagonist and food on each lower tooth, x y z in base axes, mean over the cycle, N.
        force_n: [f64; 3 * MOST_PAIRS],
        /// Where the force acts on the tooth, x y z in the platform frame, m.
        place_m: [f64; 3 * MOST_PAIRS],
    }

    /// An observation of a tap on a CAN wire: a frame, or an error message in the coding of `linux/can/error.h`.
    FrameTap on "frame" keeping 32768 as "masseter/FrameTap/d4ebc08a4b736aef" {
        /// When its last bit was on the wire, ns.
        time_ns: u64,
        /// When its transmitter had it queued, ns; 0 on real wires.
        queued_ns: u64,
        /// Identifier; bit 31 set for a 29-bit one, bit 29 for an error message.
        id: u32,
        /// Index of the bus, from 0.
        bus: u32,
        /// 0: the frame has no flags of `struct canfd_frame`.
        flags: u32,
        /// Data bytes.
        data: CanData,
    }

    /// Counters of the kernel for the machine and both loops. The recorder reads and records them; the message is not
    /// published.
    Machine on "machine" keeping 1 as "masseter/Machine/ea3cb9c208a0bc25" {
        /// Time of the sample, ns.
        time_ns: u64,
        /// Time that the hypervisor had taken from all cores together, as far as the hypervisor reports it, ns.
        stolen_ns: u64,
        /// Involuntary context switches of the controller's and the plant's loop.
        involuntary_switches: [u64; 2],
        /// Page faults of the controller and of the plant.
        page_faults: [u64; 2],
    }

    /// A single occurrence: a change of state, a fault, an alarm.
    Event on "event" keeping 1024 as "masseter/Event/21ee579a9f2571a6" {
        /// When, ns.
        time_ns: u64,
        /// Cycle of the process that reports it.
        cycle: u64,
        /// Reporter, a [`codes::Source`].
        source: u32,
        /// Kind, an [`codes::EventKind`].
        kind: u32,
        /// Cause, a [`codes::Cause`].
        cause: u32,
        /// Axis concerned, from 0; [`codes::NO_AXIS`] when none is.
        axis: u32,
        /// Object dictionary entry concerned, index · 256 + sub-index, or a COB-ID; of the controller a
        /// [`codes::NoPose`]; 0 when there is none.
        object: u32,
        /// Node id concerned; 0 when none is.
        node: u16,
        /// Index of the bus concerned, from 0, where `node` or the cause is about one.
        bus: u16,
        /// State before, as a code of the source's state type.
        from: u32,
        /// State after.
        to: u32,
        /// The value that explains it, in the cause's unit.
        value: f64,
        /// The limit it is held against, in the same unit.
        limit: f64,
    }
}

/// A lower tooth of a [`Contact`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToothContact {
    /// FDI number.
    pub number: u32,
    /// Force on it in base axes, N.
    pub force_n: [f64; 3],
    /// Where the force acts in the platform frame, m.
    pub place_m: [f64; 3],
}

impl ToothContact {
    /// The magnitude of the force, N.
    pub fn load_n(&self) -> f64 {
        self.force_n.iter().map(|force_n| force_n * force_n).sum::<f64>().sqrt()
    }
}

impl Contact {
    /// Rounds forces and places to the precision of published figures.
    pub fn round(&mut self) {
        round_figures(&mut self.force_n);
        round_figures(&mut self.place_m);
    }

    /// The teeth in the order of their numbers.
    pub fn teeth(&self) -> impl Iterator<Item = ToothContact> {
        let (forces_n, places_m) = (self.force_n.as_chunks::<3>().0, self.place_m.as_chunks::<3>().0);
        let vectors = forces_n.iter().zip(places_m);
        let tooth = |(&number, (&force_n, &place_m))| ToothContact { number, force_n, place_m };
        self.tooth.iter().zip(vectors).map(tooth).filter(|tooth| tooth.number > 0)
    }
}

impl State {
    /// Rounds the poses and their figures to the precision of published figures. The motion's time stays exact.
    pub fn round(&mut self) {
        round_figures(&mut self.desired_position_m);
        round_figures(&mut self.desired_quaternion_wxyz);
        round_figures(&mut self.estimated_position_m);
        round_figures(&mut self.estimated_quaternion_wxyz);
        round_figures(&mut self.leg_angle_rad);
        round_figures([&mut self.residual_m, &mut self.condition]);
    }
}

impl Truth {
    /// Rounds all figures but the time to the precision of published figures.
    pub fn round(&mut self) {
        round_figures(&mut self.position_m);
        round_figures(&mut self.quaternion_wxyz);
        round_figures(&mut self.joint_m);
        round_figures(&mut self.joint_m_s);
        round_figures(&mut self.force_n);
        round_figures(&mut self.force_sample_n);
        round_figures([&mut self.bite_force_n, &mut self.bite_force_sample_n]);
        round_figures(&mut self.work_j);
        round_figures([&mut self.kinetic_j, &mut self.potential_j]);
    }
}

impl Event {
    /// An event of that kind, of no axis; everything else is zero.
    pub fn new(source: Source, kind: EventKind, cause: Cause) -> Self {
        Self {
            source: source.code(),
            kind: kind.code(),
            cause: cause.code(),
            axis: NO_AXIS,
            ..Self::zeroed()
        }
    }

    /// Whether the event comes from the controller's side, which also carries out the operator's stimuli.
    pub fn is_of_controller(&self) -> bool {
        self.source == Source::Controller.code()
            || (self.source == Source::Scenario.code() && self.object == OF_OPERATOR)
    }
}

/// Rounds to the nearest number with the published precision, and halves away from zero. A number that is not finite
/// stays.
fn round_figures<'a>(values: impl IntoIterator<Item = &'a mut f64>) {
    const HALF: u64 = 1 << (ZERO_BITS - 1);
    for value in values.into_iter().filter(|value| value.is_finite()) {
        // A carry into the exponent gives the next power of two, which is right.
        let rounded = f64::from_bits((value.to_bits() + HALF) & (u64::MAX << ZERO_BITS));
        if rounded.is_finite() {
            *value = rounded;
        }
    }
}

/// Position and w x y z quaternion of a pose, for the fields of messages.
pub fn pose_fields(pose: &Pose) -> ([f64; 3], [f64; 4]) {
    let rotation = pose.rotation.quaternion();
    (pose.translation.vector.into(), [rotation.w, rotation.i, rotation.j, rotation.k])
}

/// The pose of the values from [`pose_fields`].
pub fn pose_from_fields(position_m: [f64; 3], [w, x, y, z]: [f64; 4]) -> Pose {
    let rotation = nalgebra::UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    Pose::from_parts(nalgebra::Translation3::from(position_m), rotation)
}

#[cfg(test)]
mod tests;
