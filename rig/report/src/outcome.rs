//! The outcome of a run, in a word and as an exit code. The [verdict](crate::Verdict) gives the reason.

use masseter_terminal::Exit;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Every check passed.
    Pass,
    /// A check failed.
    Fail,
    /// The machine does not allow a judgement.
    Invalid,
    /// The recording lacks something.
    Incomplete,
    /// The controller stopped safely because of a fault.
    SafeStop,
    /// A process died.
    Died,
    /// The user ended it.
    Interrupted,
}

impl Outcome {
    /// Its word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Pass => "PASS",
            Self::Fail => "FAIL",
            Self::Invalid => "INVALID",
            Self::Incomplete => "INCOMPLETE",
            Self::SafeStop => "SAFE STOP",
            Self::Died => "DIED",
            Self::Interrupted => "INTERRUPTED",
        }
    }

    /// The exit code of the program.
    pub fn exit(self) -> Exit {
        match self {
            Self::Pass => Exit::Passed,
            Self::Fail => Exit::Failed,
            Self::Invalid => Exit::Invalid,
            Self::Incomplete => Exit::Incomplete,
            Self::SafeStop => Exit::SafeStop,
            Self::Died => Exit::Died,
            Self::Interrupted => Exit::Interrupted,
        }
    }

    /// Whether the checks decided it.
    pub(crate) fn is_judged(self) -> bool {
        matches!(self, Self::Pass | Self::Fail)
    }
}
