//! The outcome that a scenario expects of its run: `[expect]`.

use serde::{Deserialize, Serialize};

use super::error::ScenarioError;

/// The outcome of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ExpectedVerdict {
    /// Every check and every requirement passes.
    Pass,
    /// A check or a requirement fails.
    Fail,
    /// A safe stop.
    SafeStop,
    /// A process dies.
    Died,
    /// The operator ends the run, or asks for a stop.
    Interrupted,
    /// The recording is incomplete.
    Incomplete,
    /// A check or a requirement was not tested.
    Untested,
}

impl ExpectedVerdict {
    /// Every outcome.
    pub const ALL: [Self; 7] = [
        Self::Pass,
        Self::Fail,
        Self::SafeStop,
        Self::Died,
        Self::Interrupted,
        Self::Incomplete,
        Self::Untested,
    ];

    /// The exit code of a run with this outcome that expects none.
    pub const fn exit_code(self) -> u8 {
        match self {
            Self::Pass => 0,
            Self::Fail | Self::Untested => 1,
            Self::Died => 4,
            Self::SafeStop => 5,
            Self::Incomplete => 6,
            Self::Interrupted => 130,
        }
    }
}

section! {
    /// The expected outcome. The run passes if the outcome is this one.
    pub struct ExpectConfig {
        /// The outcome without this table; any when absent.
        pub verdict: Option<ExpectedVerdict> = None,
        /// The exit code without this table; any when absent.
        pub exit_code: Option<u8> = None,
        /// Occurrences that the run must have.
        pub events: Vec<String> = Vec::new(),
    }
}

impl ExpectConfig {
    /// Whether an outcome is expected, by its verdict or by its exit code.
    pub fn has_outcome(&self) -> bool {
        self.verdict.is_some() || self.exit_code.is_some()
    }

    /// Whether this outcome is the expected one.
    pub fn accepts(&self, outcome: ExpectedVerdict) -> bool {
        self.has_outcome()
            && self.verdict.is_none_or(|verdict| verdict == outcome)
            && self.exit_code.is_none_or(|code| code == outcome.exit_code())
    }

    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        let Some(code) = self.exit_code else { return Ok(()) };
        if ExpectedVerdict::ALL.into_iter().any(|outcome| self.accepts(outcome)) {
            return Ok(());
        }
        let need = match self.verdict {
            Some(verdict) => format!("expect.verdict has the exit code {}: give one of both", verdict.exit_code()),
            None => "use 0, 1, 4, 5, 6 or 130; a run that cannot be judged (3) or does not start (2) is never expected"
                .to_owned(),
        };
        Err(ScenarioError::bad("expect.exit_code", &code, need))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exit_code_alone_stands_for_every_outcome_that_has_it() {
        use ExpectedVerdict::{Fail, SafeStop, Untested};
        let accepted = |verdict, exit_code| {
            let expect = ExpectConfig { verdict, exit_code, ..ExpectConfig::default() };
            let all = ExpectedVerdict::ALL.into_iter();
            all.filter(|outcome| expect.accepts(*outcome)).collect::<Vec<_>>()
        };
        assert_eq!(accepted(None, None), []);
        assert_eq!(accepted(None, Some(1)), [Fail, Untested]);
        assert_eq!(accepted(None, Some(5)), [SafeStop]);
        assert_eq!(accepted(Some(Fail), Some(1)), [Fail]);
        assert_eq!(accepted(Some(Fail), None), [Fail]);
    }
}
