//! Why a trajectory could not be built.

use crate::kinematics::ForwardError;

use super::ImportError;

/// A motion that cannot be built from its configuration.
#[derive(Debug, thiserror::Error)]
pub enum TrajectoryError {
    /// A value outside its range.
    #[error("{name} is {value}; it must be {need}")]
    OutOfRange {
        /// Configuration key.
        name: &'static str,
        /// The value given.
        value: f64,
        /// The range.
        need: &'static str,
    },
    /// The shares of a cycle do not fill it.
    #[error("phases add up to {sum}; opening, closing and occlusion must add up to 1")]
    PhaseShares {
        /// What they add up to.
        sum: f64,
    },
    /// The mandible cannot reach an amplitude with its condyles on their paths.
    #[error(
        "{name} of {desired_mm} mm is out of reach: the mandible gets to {reached_mm:.1} mm; ask for less"
    )]
    OutOfReach {
        /// Configuration key.
        name: &'static str,
        /// The amplitude asked for, mm.
        desired_mm: f64,
        /// The largest one possible, mm.
        reached_mm: f64,
    },
    /// The incisal path leads to where the mandible's length does not let it get.
    #[error(
        "at {phase:.2} of the chewing cycle the incisal point would be out of the mandible's reach; bring vertical_mm or \
         anterior_posterior_mm closer to the defaults (18 and 5), or condylar_inclination_deg (40)"
    )]
    TooWide {
        /// Where in the cycle, 0 to 1.
        phase: f64,
    },
    /// The incisal path would push the condyles out of their sockets.
    #[error(
        "at {phase:.2} of the chewing cycle the condyles would be {advance_mm:.1} mm along their paths; \
         bring anterior_posterior_mm or lateral_mm closer to what vertical_mm allows (defaults 5, 4 and 18)"
    )]
    Dislocated {
        /// Where in the cycle, 0 to 1.
        phase: f64,
        /// Advance of both condyles there, mm.
        advance_mm: f64,
    },
    /// The closed pose is none the mechanism can take.
    #[error("jaw.closed_leg_m = {closed_leg_m} m gives no closed pose: {source}")]
    NoClosedPose {
        /// Length of the legs at the closed pose, metres.
        closed_leg_m: f64,
        /// What the forward kinematics says.
        source: ForwardError,
    },
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
pub(super) fn require(
    name: &'static str,
    value: f64,
    holds: bool,
    need: &'static str,
) -> Result<f64, TrajectoryError> {
    if holds && value.is_finite() {
        Ok(value)
    } else {
        Err(TrajectoryError::OutOfRange { name, value, need })
    }
}
