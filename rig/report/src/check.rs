//! One thing that a run is checked for: its finding, and whether that is as it should be.

use serde::Serialize;

/// Whether what was checked is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CheckResult {
    /// It is.
    Passed,
    /// It is not.
    Failed,
    /// It is not, and the machine may be the cause.
    Excused,
    /// It could not show: what it needs did not happen. The finding says what to do.
    Untested,
    /// It does not apply to this run; the finding says why.
    NotJudged,
}

impl CheckResult {
    pub(crate) fn is_failed(self) -> bool {
        self == Self::Failed
    }

    /// Whether a run with it does not pass, whatever else it shows.
    pub(crate) fn is_short(self) -> bool {
        matches!(self, Self::Failed | Self::Untested)
    }

    /// The word in tables.
    pub fn mark(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAIL",
            Self::Excused => "lost",
            Self::Untested => "UNTESTED",
            Self::NotJudged => "skip",
        }
    }
}

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What.
    pub name: &'static str,
    /// What was found, with its limit.
    pub finding: String,
    /// Whether it is as it should be.
    pub result: CheckResult,
}

impl Check {
    pub(crate) fn judged(name: &'static str, finding: String, passed: bool) -> Self {
        let result = if passed { CheckResult::Passed } else { CheckResult::Failed };
        Self { name, finding, result }
    }

    /// A failure that the machine may explain is excused.
    pub(crate) fn unless(self, is_explained: bool) -> Self {
        match self.result {
            CheckResult::Failed if is_explained => Self { result: CheckResult::Excused, ..self },
            _ => self,
        }
    }

    pub(crate) fn untested(name: &'static str, why: String) -> Self {
        Self { name, finding: why, result: CheckResult::Untested }
    }

    pub(crate) fn not_judged(name: &'static str, why: String) -> Self {
        Self { name, finding: why, result: CheckResult::NotJudged }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_untested_has_not_failed_and_does_not_pass() {
        use CheckResult::{Excused, Failed, NotJudged, Passed, Untested};
        let results = [Passed, Failed, Excused, Untested, NotJudged];
        assert_eq!(results.map(CheckResult::is_failed), [false, true, false, false, false]);
        assert_eq!(results.map(CheckResult::is_short), [false, true, false, true, false]);
    }

    #[test]
    fn only_a_failure_is_excused() {
        let check = |passed| Check::judged("tracking", String::new(), passed);
        let cases = [(false, true, "lost"), (false, false, "FAIL"), (true, true, "ok"), (true, false, "ok")];
        for (passed, excused, mark) in cases {
            assert_eq!(check(passed).unless(excused).result.mark(), mark);
        }
    }
}
