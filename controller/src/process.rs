//! The controller's process: which controller runs, and how it is built from a scenario.

use masseter_shared::config::Scenario;
use masseter_shared::control::{Outcome, process};
use masseter_shared::geometry::{GeometryError, Mechanism};
use masseter_shared::lifecycle::{ProcessArguments, ProcessError};

use crate::hold_position::HoldPosition;
use crate::motion_controller::MotionController;
use crate::trajectory::{Trajectory, TrajectoryError};

/// The controllers of this crate.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Kind {
    /// Plays the scenario's motion.
    #[default]
    Motion,
    /// Holds the position found at the start, for as long as the motion takes.
    Hold,
}

/// Why a controller could not be built or could not run.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// The start of the process, or its messages.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The motion.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

/// Runs a controller until it is done.
///
/// # Errors
/// [`ControllerError`] when the scenario cannot be used, or the process cannot start or loses its messages.
pub fn run(arguments: &ProcessArguments, kind: Kind) -> Result<Outcome, ControllerError> {
    match kind {
        Kind::Motion => process::run(arguments, |scenario| {
            let (mechanism, trajectory) = motion(scenario)?;
            Ok(MotionController::new(scenario, mechanism, trajectory))
        }),
        Kind::Hold => process::run(arguments, |scenario| {
            let (mechanism, trajectory) = motion(scenario)?;
            Ok(HoldPosition::new(scenario, mechanism, trajectory.duration_s()))
        }),
    }
}

fn motion(scenario: &Scenario) -> Result<(Mechanism, Trajectory), ControllerError> {
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
    Ok((mechanism, trajectory))
}
