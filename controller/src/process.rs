//! The controller's process: builds mechanism, motion and controller of a scenario, and runs them.

use masseter_model::geometry::{GeometryError, Mechanism};
use masseter_runtime::control::{Controller, Outcome, Session};
use masseter_runtime::lifecycle::attach::{AttachError, attach};
use masseter_runtime::lifecycle::{ProcessArguments, ProcessContext, ProcessError};
use masseter_scenario::Scenario;

use crate::trajectory::{Trajectory, TrajectoryError};
use crate::{motion_controller::MotionController, pose_law::PoseLaw};

/// Builds a controller for a scenario, its mechanism and its motion.
pub type BuildController = fn(&Scenario, Mechanism, Trajectory) -> Box<dyn Controller>;

/// Why a controller cannot be built or cannot run.
#[derive(Debug, thiserror::Error)]
pub enum ControllerError {
    /// The start of the process, or its messages.
    #[error(transparent)]
    Process(#[from] ProcessError),
    /// Every rig refuses this program.
    #[error(transparent)]
    Attach(#[from] AttachError),
    /// The mechanism's dimensions.
    #[error(transparent)]
    Geometry(#[from] GeometryError),
    /// The motion.
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

/// Runs the controller of `build` to its end.
///
/// # Errors
/// [`ControllerError`] for an unusable scenario, a failed start, or lost messages.
pub fn run(arguments: &ProcessArguments, build: BuildController) -> Result<Outcome, ControllerError> {
    play(arguments.init()?, build)
}

/// Runs a controller for a waiting rig: the named rig, or the rig that [`attach`] finds.
///
/// # Errors
/// As [`run`], and a failed attachment.
pub fn run_attached(rig: Option<&str>, build: BuildController) -> Result<Outcome, ControllerError> {
    play(attach(rig)?, build)
}

/// Runs [`MotionController`] with this pose law, on an attached program's part of a run.
///
/// # Errors
/// As [`run`].
pub fn run_with_law(context: ProcessContext, law: Box<dyn PoseLaw>) -> Result<Outcome, ControllerError> {
    play(context, |scenario, mechanism, motion| {
        Box::new(MotionController::with_law(scenario, mechanism, motion, law))
    })
}

fn play(
    context: ProcessContext,
    build: impl FnOnce(&Scenario, Mechanism, Trajectory) -> Box<dyn Controller>,
) -> Result<Outcome, ControllerError> {
    let mut controller = for_scenario(&context.scenario, build)?;
    Ok(Session::start(context, controller.declared())?.run(&mut *controller)?)
}

/// Builds a controller for the mechanism and the motion of a scenario.
///
/// # Errors
/// [`ControllerError`] if either is unusable.
pub fn for_scenario(
    scenario: &Scenario,
    build: impl FnOnce(&Scenario, Mechanism, Trajectory) -> Box<dyn Controller>,
) -> Result<Box<dyn Controller>, ControllerError> {
    let mechanism = Mechanism::new(&scenario.mechanism)?;
    let trajectory = Trajectory::of_scenario(scenario, &mechanism)?;
    Ok(build(scenario, mechanism, trajectory))
}
