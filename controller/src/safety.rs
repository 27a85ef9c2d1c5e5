//! Checks that stop the controller: each fault has a cause, a value and a limit.

use masseter_model::geometry::{AXES, Actuators, InverseError, LEGS, LimitViolation, Pose};
use masseter_runtime::messages::codes::{Cause, DriveState, NO_AXIS, NoPose, drive_state};
use masseter_runtime::messages::{Event, Reading};

use crate::{kinematics::ForwardError, pose_law::LawFailed};

/// Largest error of a quaternion's length: beyond it, the error moves the platform's points by this share of their
/// distance.
const MOST_NORM_ERROR: f64 = 1e-6;

/// A fault, in the form of an event.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fault {
    /// The cause.
    pub cause: Cause,
    /// The axis concerned, if one is.
    pub axis: Option<usize>,
    /// The value that broke the limit, in the cause's unit.
    pub value: f64,
    /// The limit.
    pub limit: f64,
    /// The reason for a missing pose, for faults of kinematics.
    pub no_pose: Option<NoPose>,
}

impl Fault {
    /// A fault of the whole rig.
    pub fn new(cause: Cause, value: f64, limit: f64) -> Self {
        Self { cause, axis: None, value, limit, no_pose: None }
    }

    fn for_axis(cause: Cause, axis: usize, value: f64, limit: f64) -> Self {
        Self { axis: Some(axis), ..Self::new(cause, value, limit) }
    }

    /// A fault of kinematics, of one leg or of the whole mechanism.
    fn for_kinematics(cause: Cause, reason: NoPose, leg: Option<usize>, value: f64) -> Self {
        Self { axis: leg.map(|leg| LEGS + leg), no_pose: Some(reason), ..Self::new(cause, value, 0.0) }
    }

    /// Fills the event's explanation.
    pub(crate) fn explain(&self, event: &mut Event) {
        event.cause = self.cause.code();
        event.axis = self.axis.map_or(NO_AXIS, |axis| axis as u32);
        event.object = self.no_pose.map_or(0, NoPose::code);
        (event.value, event.limit) = (self.value, self.limit);
    }
}

impl From<LimitViolation> for Fault {
    fn from(violation: LimitViolation) -> Self {
        Self::for_axis(Cause::StrokeLimit, violation.axis, violation.value_m, violation.limit_m())
    }
}

impl From<&ForwardError> for Fault {
    fn from(error: &ForwardError) -> Self {
        let (reason, leg) = match *error {
            ForwardError::NotFinite => (NoPose::NotFinite, None),
            ForwardError::NoLength { leg, .. } => (NoPose::NoLength, Some(leg)),
            ForwardError::Unassemblable => (NoPose::Unassemblable, None),
            ForwardError::WrongAssembly { .. } => (NoPose::WrongAssembly, None),
            ForwardError::Ambiguous { .. } => (NoPose::Ambiguous, None),
            ForwardError::Undecided { .. } => (NoPose::Undecided, None),
            ForwardError::NoConvergence { .. }
            | ForwardError::Stalled { .. }
            | ForwardError::Singular { .. } => (NoPose::NotFound, None),
        };
        let residual_m = error.residual_m().unwrap_or(f64::NAN);
        Self::for_kinematics(Cause::ForwardKinematics, reason, leg, residual_m)
    }
}

impl From<InverseError> for Fault {
    fn from(error: InverseError) -> Self {
        let (reason, leg) = match error {
            InverseError::NotFinite => (NoPose::NotFinite, None),
            InverseError::NoLength { leg, .. } => (NoPose::NoLength, Some(leg)),
        };
        Self::for_kinematics(Cause::InverseKinematics, reason, leg, f64::NAN)
    }
}

impl From<LawFailed> for Fault {
    fn from(_: LawFailed) -> Self {
        Self::new(Cause::LawFailed, 0.0, 0.0)
    }
}

/// Whether a law's pose consists of finite numbers, and its quaternion has the length 1.
pub(crate) fn check_asked(asked: &Pose) -> Result<(), Fault> {
    let position = &asked.translation.vector;
    if let Some(&value_m) = position.iter().find(|value_m| !value_m.is_finite()) {
        return Err(Fault::new(Cause::LawFailed, value_m, 0.0));
    }
    let norm = asked.rotation.quaternion().norm();
    let is_rotation = (norm - 1.0).abs() < MOST_NORM_ERROR;
    if is_rotation { Ok(()) } else { Err(Fault::new(Cause::LawFailed, norm, 1.0)) }
}

/// Whether every value of a reading is a number, and every code known.
pub(crate) fn check_reading(reading: &Reading) -> Result<(), Fault> {
    for axis in 0..AXES {
        let code = reading.drive_state[axis];
        let values = [
            (reading.position_m[axis], reading.position_m[axis].is_finite()),
            (reading.force_n[axis], reading.force_n[axis].is_finite()),
            (f64::from(code), drive_state(code).is_ok()),
        ];
        if let Some((value, _)) = values.into_iter().find(|(_, is_good)| !is_good) {
            return Err(Fault::for_axis(Cause::BadMessage, axis, value, 0.0));
        }
    }
    if !reading.load_cell_n.is_finite() {
        return Err(Fault::new(Cause::BadMessage, reading.load_cell_n, 0.0));
    }
    Ok(())
}

/// Whether the reading answers a command of this controller; `last_sent` is the cycle of its last command.
pub(crate) fn check_commander(reading: &Reading, last_sent: u64) -> Result<(), Fault> {
    if reading.answers_cycle > last_sent {
        return Err(Fault::new(Cause::ForeignCommand, reading.answers_cycle as f64, last_sent as f64));
    }
    Ok(())
}

/// Whether the master serves, no drive is in fault, and, once `moving`, all drives are enabled.
pub(crate) fn check_drives(reading: &Reading, moving: bool) -> Result<(), Fault> {
    if reading.master_fault != 0 {
        return Err(Fault::new(Cause::MasterFault, 1.0, 0.0));
    }
    for (axis, &code) in reading.drive_state.iter().enumerate() {
        let state = drive_state(code).ok().flatten();
        let faulty = matches!(state, Some(DriveState::Fault | DriveState::FaultReactionActive));
        if faulty || (moving && state != Some(DriveState::OperationEnabled)) {
            let enabled = f64::from(DriveState::OperationEnabled.code());
            return Err(Fault::for_axis(Cause::DriveFault, axis, f64::from(code), enabled));
        }
    }
    Ok(())
}

/// Whether the drives can reach the targets within a period at their speed.
pub(crate) fn check_velocity(
    targets: &Actuators,
    before: &Actuators,
    velocity_limit_m_s: &[f64; AXES],
    period_s: f64,
) -> Result<(), Fault> {
    let steps = targets.to_axes().into_iter().zip(before.to_axes()).map(|(to, from)| (to - from).abs());
    for (axis, (step_m, limit_m_s)) in steps.zip(velocity_limit_m_s).enumerate() {
        let velocity_m_s = step_m / period_s;
        if velocity_m_s > *limit_m_s {
            return Err(Fault::for_axis(Cause::VelocityLimit, axis, velocity_m_s, *limit_m_s));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
