//! What a scenario of a suite came to.

use std::path::PathBuf;

use masseter_report::Verdict;
use masseter_terminal::Exit;

use super::case::Case;

/// The word of a verdict on a run that left something untested.
const UNTESTED: &str = "UNTESTED";

/// A scenario that was run.
#[derive(Debug)]
pub(super) struct Tested {
    pub(super) case: Case,
    pub(super) outcome: Outcome,
    /// Its verdict and reason, or why it could not run.
    pub(super) reason: String,
    /// None of a scenario that could not run.
    pub(super) verdict: Option<Verdict>,
    /// The command that shows the run again.
    pub(super) command: String,
    /// The folder of the run, if it was kept.
    pub(super) folder: Option<PathBuf>,
    /// How often it was run again until it passed or the tries were over.
    pub(super) retries: u32,
    /// The time that it took, s.
    pub(super) took_s: f64,
}

/// How a scenario counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Outcome {
    Passed,
    Failed,
    Untested,
}

impl Outcome {
    pub(super) fn of(verdict: &Verdict) -> Self {
        match verdict.exit_code {
            Exit::Passed => Self::Passed,
            _ if verdict.word == UNTESTED => Self::Untested,
            _ => Self::Failed,
        }
    }

    /// The word in the list of tests.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAILED",
            Self::Untested => UNTESTED,
        }
    }

    /// Whether a suite with it does not pass.
    pub(super) fn is_short(self, allow_untested: bool) -> bool {
        match self {
            Self::Passed => false,
            Self::Failed => true,
            Self::Untested => !allow_untested,
        }
    }
}
