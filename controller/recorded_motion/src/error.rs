//! Refusals of a motion, which readers of files and generators share.

use masseter_model::section;

/// A motion that cannot be built or followed: the key or the line of the recording, the error there, and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TrajectoryError(pub String);

/// Refuses a value that does not fulfil its condition, or is not finite.
///
/// # Errors
/// With the name, the value, and the need.
pub fn require(name: &str, value: f64, holds: bool, need: &str) -> Result<(), TrajectoryError> {
    let problem = || TrajectoryError(format!("{name} is {value:?}; it must be {need}"));
    if holds && value.is_finite() { Ok(()) } else { Err(problem()) }
}

/// Refuses a number out of the declared range of its key, in this table.
pub fn ranges_of(table: &str) -> impl Fn(&str, section::Range, f64) -> Result<(), TrajectoryError> {
    move |key, range, number| {
        if range.contains(number) {
            return Ok(());
        }
        Err(TrajectoryError(format!("{table}.{key} is {number:?}; it must be {}", range.of_key(key))))
    }
}
