//! A scenario's requirements of its run, and the expected outcome: `[[require]]` and `[expect]`.
//!
//! This module holds the text alone. The crate `masseter-judge` resolves and judges signals, conditions and their
//! units.

use serde::{Deserialize, Serialize};

use super::error::{Checked, ScenarioError, require};
use super::quantity::Quantity;
use crate::input::is_printable;

/// The time of a requirement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum During {
    /// While a condition holds, such as `running` for the controller's state, or `bite.force > 5 N`.
    While(String),
    /// A time of the motion, or after an occurrence.
    Time(TimeWindow),
}

/// A window of time.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TimeWindow {
    /// From when on, s since the motion began.
    pub from_s: Option<f64>,
    /// Until when, s since the motion began.
    pub to_s: Option<f64>,
    /// From this occurrence on, such as `fault.encoder_stuck`.
    pub after: Option<String>,
    /// For how long after it, s.
    pub for_s: Option<f64>,
}

/// The statistic of a signal for the bounds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Statistic {
    /// Every value.
    #[default]
    Value,
    /// Every value's size, without its sign.
    Abs,
    /// The mean.
    Mean,
    /// The root of the mean square.
    Rms,
    /// The largest value less the smallest.
    PeakToPeak,
    /// The value that `percentile` of the samples do not exceed.
    Percentile,
}

keys! {
    /// One requirement: bounds of a signal, a response, a condition that must never hold, a number of occurrences, or their
    /// order.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct RequirementConfig {
        /// Name in reports.
        pub name: String => "1 to 120 characters, required",
        /// Requirement of your own list that it shows, such as `REQ-12`; several may show the same.
        pub id: Option<String> => "1 to 64 bytes without spaces",
        /// Bounds: the signal.
        pub signal: Option<String> => "a line of `masseter signals`",
        /// Bounds: an expression of signals in SI units, instead of `signal`.
        pub expression: Option<String>,
        /// Unit of the expression.
        pub unit: Option<String> => "with `expression`",
        /// When it is judged; by default the whole run.
        pub during: Option<During> => "a state, a condition, or a table",
        /// Whether a window, or a `stays_for`, that the end of the run cuts leaves the requirement untested.
        pub whole: bool => "not with `order`",
        /// Bounds: what of the signal.
        pub statistic: Statistic,
        /// Bounds: the percentile, 0 to 100.
        pub percentile: Option<f64> => Within(0.0, 100.0) "with `statistic = \"percentile\"`",
        /// Bounds: smallest allowed value.
        pub min: Option<Quantity> => "with its unit, such as `\"0.5 mm\"`",
        /// Bounds: largest allowed value.
        pub max: Option<Quantity> => "with its unit",
        /// Response: the trigger.
        pub when: Option<String> => "a condition or an occurrence",
        /// Response: what must follow.
        pub then: Option<String> => "a condition",
        /// Response: not before so long after the trigger.
        pub delay: Option<Quantity> => "a time, such as `\"5 ms\"`",
        /// Response: at the latest so long after the trigger.
        pub within: Option<Quantity> => "a time",
        /// Response: holds for so long.
        pub stays_for: Option<Quantity> => "a time",
        /// The condition that must never hold.
        pub never: Option<String> => "a condition or an occurrence",
        /// Count: the occurrence.
        pub event: Option<String> => "an occurrence",
        /// Count: smallest allowed number.
        pub at_least: Option<u64>,
        /// Count: largest allowed number.
        pub at_most: Option<u64>,
        /// Occurrences whose first ones come in this order.
        pub order: Vec<String> => "occurrences",
    }
}

impl RequirementConfig {
    pub(super) fn validate(&self) -> Checked {
        let is_line = !self.name.chars().any(char::is_control) && self.name.chars().count() <= 120;
        let is_name = is_line && !self.name.trim().is_empty();
        let name = format!("'{}'", self.name);
        require(is_name, "require.name", &name, "use 1 to 120 characters in one line")?;
        let id = self.id.as_deref().unwrap_or("-");
        let is_id = !id.is_empty() && !id.contains(char::is_whitespace) && is_printable(id, 64);
        require(is_id, "require.id", &format!("'{id}'"), "use 1 to 64 bytes without spaces, such as REQ-12")
    }
}

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

    /// The exit code of a run with this outcome and no expectation.
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
        /// Outcome that makes the run pass.
        pub verdict: Option<ExpectedVerdict> = None,
        /// Exit code that makes the run pass: that which the run would have without this table.
        pub exit_code: Option<u8> = None => "0, 1, 4, 5, 6, 130; that of `verdict`, if both are given",
        /// Occurrences that the run must have.
        pub events: Vec<String> = Vec::new() => "occurrences",
        /// Checks and requirements that must fail; every other one must pass.
        pub failed: Vec<String> = Vec::new() => "names; required with `verdict = \"fail\"`, or `exit_code = 1` alone",
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

    pub(super) fn validate(&self) -> Checked {
        self.validate_exit_code()?;
        let failed = format!("{:?}", self.failed);
        let need = match (self.accepts(ExpectedVerdict::Fail), self.failed.is_empty()) {
            (true, true) => {
                "name the checks and requirements that must fail: any other failure would pass unseen"
            }
            (false, false) => "it goes with verdict = \"fail\"",
            _ => return Ok(()),
        };
        Err(ScenarioError::bad("expect.failed", &failed, need))
    }

    fn validate_exit_code(&self) -> Checked {
        let Some(code) = self.exit_code else { return Ok(()) };
        let need = match self.verdict {
            Some(verdict) => format!("expect.verdict has the exit code {}: give one of both", verdict.exit_code()),
            None => "use 0, 1, 4, 5, 6 or 130; a run that cannot be judged (3) or does not start (2) is never expected"
                .to_owned(),
        };
        let is_possible = ExpectedVerdict::ALL.into_iter().any(|outcome| self.accepts(outcome));
        require(is_possible, "expect.exit_code", &code, need)
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
