//! The outcomes of a run, each with its word and its exit code.

use masseter_scenario::ExpectedVerdict::{
    self, Died, Fail, Incomplete, Interrupted, Pass, SafeStop, Untested,
};
use masseter_terminal::Exit;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// One that a scenario can expect.
    Named(ExpectedVerdict),
    /// Failed, by checks alone: their findings are the reason.
    ChecksFailed,
    /// The run cannot be judged, which no scenario expects.
    Invalid,
}

impl Outcome {
    /// Its name in `[expect]`; none of a run that cannot be judged.
    pub(crate) fn named(self) -> Option<ExpectedVerdict> {
        match self {
            Self::Named(outcome) => Some(outcome),
            Self::ChecksFailed => Some(Fail),
            Self::Invalid => None,
        }
    }

    pub(crate) fn word(self) -> &'static str {
        self.word_and_exit().0
    }

    pub(crate) fn exit(self) -> Exit {
        self.word_and_exit().1
    }

    /// The word in reports, and the exit code of the program. A test that tested nothing is as red as one that failed.
    pub(crate) fn word_and_exit(self) -> (&'static str, Exit) {
        match self.named() {
            Some(Pass) => ("PASS", Exit::Passed),
            Some(Fail) => ("FAIL", Exit::Failed),
            Some(Untested) => ("UNTESTED", Exit::Failed),
            Some(Died) => ("DIED", Exit::Died),
            Some(SafeStop) => ("SAFE STOP", Exit::SafeStop),
            Some(Incomplete) => ("INCOMPLETE", Exit::Incomplete),
            Some(Interrupted) => ("INTERRUPTED", Exit::Interrupted),
            None => ("INVALID", Exit::Invalid),
        }
    }
}
