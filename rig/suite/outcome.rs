//! What a scenario of a suite came to.

use std::path::PathBuf;

use masseter_report::{JunitRun, Verdict};
use masseter_terminal::Exit;

use super::case::Case;
use crate::BUILD;

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

impl Tested {
    /// It as a test suite of a JUnit document.
    pub(super) fn junit(&self, allow_untested: bool) -> JunitRun<'_> {
        let verdict = self.verdict.as_ref().ok_or(self.reason.as_str());
        let properties = vec![
            ("masseter", BUILD.to_owned()),
            ("outcome", self.outcome.word().to_owned()),
            ("retries", self.retries.to_string()),
        ];
        let is_short = self.outcome.is_short(allow_untested);
        JunitRun::new(&self.case.name, verdict, is_short, self.took_s).with(properties)
    }
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
