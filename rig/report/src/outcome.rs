//! What a run comes to: a word in reports, and the exit code of the program.

use masseter_scenario::ExpectedVerdict;
use masseter_terminal::Exit;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Outcome {
    Passed,
    Failed,
    /// Nothing failed, and something that the scenario asks for was not tested.
    Untested,
    Invalid,
    Died,
    SafeStop,
    Incomplete,
    Interrupted,
}

impl Outcome {
    /// The outcome that a scenario expects.
    pub(crate) fn of(expected: ExpectedVerdict) -> Self {
        match expected {
            ExpectedVerdict::Pass => Self::Passed,
            ExpectedVerdict::Fail => Self::Failed,
            ExpectedVerdict::SafeStop => Self::SafeStop,
            ExpectedVerdict::Died => Self::Died,
            ExpectedVerdict::Interrupted => Self::Interrupted,
            ExpectedVerdict::Incomplete => Self::Incomplete,
            ExpectedVerdict::Untested => Self::Untested,
        }
    }

    /// The name of the outcome in `[expect]`. No scenario expects a run that cannot be judged.
    pub(crate) fn named(self) -> Option<ExpectedVerdict> {
        ExpectedVerdict::ALL.into_iter().find(|expected| Self::of(*expected) == self)
    }

    /// The word in reports.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Passed => "PASS",
            Self::Failed => "FAIL",
            Self::Untested => "UNTESTED",
            Self::Invalid => "INVALID",
            Self::Died => "DIED",
            Self::SafeStop => "SAFE STOP",
            Self::Incomplete => "INCOMPLETE",
            Self::Interrupted => "INTERRUPTED",
        }
    }

    /// A test that tested nothing is as red as one that failed.
    pub(crate) fn exit(self) -> Exit {
        match self {
            Self::Passed => Exit::Passed,
            Self::Failed | Self::Untested => Exit::Failed,
            Self::Invalid => Exit::Invalid,
            Self::Died => Exit::Died,
            Self::SafeStop => Exit::SafeStop,
            Self::Incomplete => Exit::Incomplete,
            Self::Interrupted => Exit::Interrupted,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exit_codes_of_scenarios_are_those_of_the_program() {
        for expected in ExpectedVerdict::ALL {
            assert_eq!(Outcome::of(expected).exit() as u8, expected.exit_code(), "{expected:?}");
        }
        assert_eq!((Outcome::Invalid.named(), Outcome::Died.named()), (None, Some(ExpectedVerdict::Died)));
    }
}
