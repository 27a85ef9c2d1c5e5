//! The controller's process: the mechanism and the motion of its scenario, and the controller that is built for them.

use masseter_shared::config::Scenario;
use masseter_shared::control::{Controller, Outcome, process};
use masseter_shared::geometry::{GeometryError, Mechanism};
use masseter_shared::lifecycle::{ProcessArguments, ProcessError};

use crate::trajectory::{Trajectory, TrajectoryError};

/// Builds a controller for a scenario, its mechanism and its motion.
pub type BuildController = fn(&Scenario, Mechanism, Trajectory) -> Box<dyn Controller>;

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

/// Runs the controller that `build` makes, until it is done.
///
/// # Errors
/// [`ControllerError`] when the scenario cannot be used, or the process cannot start or loses its messages.
pub fn run(arguments: &ProcessArguments, build: BuildController) -> Result<Outcome, ControllerError> {
    process::run(arguments, |scenario| {
        let mechanism = Mechanism::new(&scenario.mechanism)?;
        let trajectory = Trajectory::new(&scenario.motion, &scenario.jaw, &mechanism, scenario.duration_s)?;
        Ok(build(scenario, mechanism, trajectory))
    })
}
