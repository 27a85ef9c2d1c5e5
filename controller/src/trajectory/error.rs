//! Why a trajectory cannot be built or followed.

use std::path::Path;

/// A motion that cannot be built or followed: the key, or the line of the recording, what is wrong there, and the remedy.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TrajectoryError(pub(super) String);

/// Passes a value on if it fulfils its condition and is finite.
pub(super) fn require(name: &str, value: f64, holds: bool, need: &str) -> Result<f64, TrajectoryError> {
    if holds && value.is_finite() {
        Ok(value)
    } else {
        Err(TrajectoryError(format!("{name} is {value:?}; it must be {need}")))
    }
}

/// A problem of a recording, before its path is known.
#[derive(Debug)]
pub(super) struct Located {
    /// The line, from 1; none where the file as a whole is at fault.
    pub line: Option<u64>,
    /// What is wrong, with its remedy: for the person who corrects the file.
    pub problem: String,
}

impl Located {
    pub(super) fn at(line: u64, problem: String) -> Self {
        Self { line: Some(line), problem }
    }

    pub(super) fn whole(problem: String) -> Self {
        Self { line: None, problem }
    }

    pub(super) fn in_file(self, path: &Path) -> TrajectoryError {
        let line = self.line.map_or_else(String::new, |line| format!(":{line}"));
        TrajectoryError(format!("{}{line}: {}", path.display(), self.problem))
    }
}
