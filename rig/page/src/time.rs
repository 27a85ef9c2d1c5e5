//! The time of a run, and what happened when. All times are seconds since the run's first SYNC.

use serde::Serialize;

/// How the page shows times: since the motion began, by cycle, or by the clock on the wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Time {
    /// When the motion began; none where it did not.
    pub motion_s: Option<f64>,
    /// When the last value came.
    pub end_s: f64,
    /// Period of the cycle, s.
    pub period_s: f64,
    /// The first SYNC on the wall's clock, s since 1970-01-01 00:00 UTC; none in simulated time.
    pub wall_s: Option<f64>,
}

impl Default for Time {
    fn default() -> Self {
        Self { motion_s: None, end_s: 0.0, period_s: 1e-3, wall_s: None }
    }
}

/// What a moment is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum MomentKind {
    /// A fault of the scenario strikes.
    Fault,
    /// The rig notices a fault and begins a safe stop.
    Detection,
    /// Anything else.
    Note,
}

/// A moment that charts mark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Moment {
    /// When.
    pub at_s: f64,
    /// What it is.
    pub kind: MomentKind,
    /// A word or two for the charts.
    pub name: String,
    /// A sentence.
    pub text: String,
}

/// A stretch of time in which the controller was in one state.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Its beginning.
    pub from_s: f64,
    /// Its end.
    pub to_s: f64,
    /// The state's name.
    pub name: String,
}
