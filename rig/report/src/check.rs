//! One thing that a run is checked for: its finding, and whether that is as it should be.

use std::borrow::Cow;

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

/// The figures of a requirement beside its check.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CheckFigures {
    /// How far the requirement is from failing.
    pub margin: Option<f64>,
    /// Unit of the margin.
    pub margin_unit: &'static str,
    /// The margin as a share of the limit.
    pub relative_margin: Option<f64>,
    /// The moment of the smallest margin, s since the motion began.
    pub worst_at_s: Option<f64>,
    /// The longest time from a trigger to its response, ms.
    pub latency_ms: Option<f64>,
    /// Whether it is an event that `[expect]` names.
    #[serde(skip)]
    pub(crate) is_expected_event: bool,
}

/// One thing that was judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// What.
    pub name: Cow<'static, str>,
    /// What was found, with its limit.
    pub finding: String,
    /// Whether it is as it should be.
    pub result: CheckResult,
    /// The figures, where it is a requirement of the scenario.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub figures: Option<CheckFigures>,
}

impl Check {
    pub(crate) fn new(name: impl Into<Cow<'static, str>>, finding: String, result: CheckResult) -> Self {
        Self { name: name.into(), finding, result, figures: None }
    }

    /// Whether it is a requirement of the scenario.
    pub(crate) fn is_requirement(&self) -> bool {
        self.figures.is_some()
    }

    /// Whether it is an event that the scenario expects of the run.
    pub(crate) fn is_expected_event(&self) -> bool {
        self.figures.as_ref().is_some_and(|figures| figures.is_expected_event)
    }

    pub(crate) fn judged(name: &'static str, finding: String, passed: bool) -> Self {
        let result = if passed { CheckResult::Passed } else { CheckResult::Failed };
        Self::new(name, finding, result)
    }

    /// A failure that the machine may explain is excused.
    pub(crate) fn unless(self, is_explained: bool) -> Self {
        match self.result {
            CheckResult::Failed if is_explained => Self { result: CheckResult::Excused, ..self },
            _ => self,
        }
    }

    pub(crate) fn untested(name: &'static str, why: String) -> Self {
        Self::new(name, why, CheckResult::Untested)
    }

    pub(crate) fn not_judged(name: &'static str, why: String) -> Self {
        Self::new(name, why, CheckResult::NotJudged)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_untested_has_not_failed() {
        use CheckResult::{Excused, Failed, NotJudged, Passed, Untested};
        let results = [Passed, Failed, Excused, Untested, NotJudged];
        assert_eq!(results.map(CheckResult::is_failed), [false, true, false, false, false]);
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
