//! Trajectories: the desired pose of the platform as a function of time.
//!
//! The constructor builds a trajectory once from a scenario: it reads files, solves motions and allocates memory. The
//! loop evaluates the trajectory without allocation and without iteration. A trajectory comes from a generator on a
//! rigid mandible ([`MotionConfig`](masseter_scenario::MotionConfig)'s kinds) or from a recording, and starts and ends
//! at rest. [`check`] judges beforehand whether the mechanism can follow. The rig's way to the first pose is not part
//! of a trajectory.

mod c3d;
mod check;
mod columns;
mod doubts;
mod extras;
mod frames;
mod generators;
mod import;
mod layout;
mod mandible;
mod markers;
mod motion;
mod plausible;
mod recording;
mod row;
mod sheet;
mod signals;
mod survey;
mod table;
mod units;

use masseter_model::{geometry::Pose, section};

pub use check::{TrajectoryReport, check};
pub use doubts::Glitch;
pub use frames::{Frame, Frames};
pub(crate) use generators::minimum_jerk;
pub use import::plain_form;
pub use mandible::{closed_jaw_points, closed_pose};
pub use motion::Trajectory;
pub use plausible::Implausible;
pub use signals::{RecordedSignal, recorded_signals};
pub use survey::{Gap, PointFigures, Range, RecordingSurvey, StepFigures, SurveyRow, survey};
pub use units::Unit;

/// A motion that cannot be built or followed: the key or the line of the recording, the error there, and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TrajectoryError(String);

/// Refuses a value that does not fulfil its condition, or is not finite.
fn require(name: &str, value: f64, holds: bool, need: &str) -> Result<(), TrajectoryError> {
    let problem = || TrajectoryError(format!("{name} is {value:?}; it must be {need}"));
    if holds && value.is_finite() { Ok(()) } else { Err(problem()) }
}

/// Refuses a number out of the declared range of its key, in this table.
fn ranges_of(table: &str) -> impl Fn(&str, section::Range, f64) -> Result<(), TrajectoryError> {
    move |key, range, number| {
        if range.contains(number) {
            return Ok(());
        }
        Err(TrajectoryError(format!("{table}.{key} is {number:?}; it must be {}", range.of_key(key))))
    }
}

/// The pose at a share of the way from one pose to another, for position and turn.
pub(crate) fn interpolate(from: &Pose, to: &Pose, share: f64) -> Pose {
    let turn = from.rotation.rotation_to(&to.rotation).scaled_axis() * share;
    let position = from.translation.vector.lerp(&to.translation.vector, share);
    Pose::from_parts(position.into(), nalgebra::UnitQuaternion::from_scaled_axis(turn) * from.rotation)
}

#[cfg(test)]
mod tests;
