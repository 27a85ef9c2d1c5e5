//! Why a trajectory could not be built.

use super::ImportError;

/// A motion that cannot be built from its configuration.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// A value that the motion cannot have: its key, what the motion would come to, and the remedy.
    #[error("{0}")]
    Motion(String),
    /// The recording cannot be used.
    #[error(transparent)]
    Import(Box<ImportError>),
}

impl From<ImportError> for TrajectoryError {
    fn from(error: ImportError) -> Self {
        Self::Import(Box::new(error))
    }
}

/// Passes a value on if it fulfils its condition and is finite.
pub(super) fn require(name: &str, value: f64, holds: bool, need: &str) -> Result<f64, TrajectoryError> {
    if holds && value.is_finite() {
        Ok(value)
    } else {
        Err(TrajectoryError::Motion(format!("{name} is {value}; it must be {need}")))
    }
}
