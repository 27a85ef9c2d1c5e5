//! What a requirement comes to, or why it cannot be judged.

use masseter_scenario::Unit;
use serde::Serialize;

use super::missing::Missing;
use crate::check::{CheckFigures, CheckResult};
use crate::{breach::Breach, series::Curve, signals::UnknownSignal};

/// The judgement of a requirement, in SI units.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Finding {
    pub(super) result: CheckResult,
    /// The finding, in words.
    pub(super) text: String,
    /// How far the requirement is from failing; negative where it fails.
    pub(super) margin: Option<f64>,
    /// The margin as a share of the limit.
    pub(super) relative_margin: Option<f64>,
    /// Unit in which the margin is shown.
    pub(super) unit: Unit,
    /// The moment of the smallest margin.
    pub(super) worst_ns: Option<u64>,
    /// The longest time from a trigger to its response, s.
    pub(super) latency_s: Option<f64>,
    /// The first value beyond its limit; none where it passes.
    pub(super) breach: Option<Breach>,
    /// Whether the machine may have caused a failure, where the machine lost cycles.
    pub(super) may_be_disturbed: bool,
}

impl Finding {
    /// The requirement could not show; `why` says what did not happen.
    pub(super) fn untested(why: String, unit: Unit) -> Self {
        Self { may_be_disturbed: false, ..Self::new(true, why, unit) }.into_untested()
    }

    /// What passes with values missing in between is untested; the machine may have lost them.
    pub(super) fn with_missing(self, missing: &Missing) -> Self {
        let text = self.text + &missing.in_words();
        match self.result {
            CheckResult::Passed if missing.is_too_much() => Self { text, ..self }.into_untested(),
            _ => Self { text, ..self },
        }
    }

    /// What passes, but for triggers that no sample shows, is untested; the machine may have lost the samples.
    pub(super) fn with_unseen(self, triggers: u64) -> Self {
        if triggers > 0 && self.result == CheckResult::Passed { self.into_untested() } else { self }
    }

    /// A window that the run's end cut, in words. One that must be whole leaves what passes untested.
    pub(super) fn with_cut(self, part: Option<String>, is_whole: bool) -> Self {
        let Some(part) = part else { return self };
        let text = format!("{}; {part}", self.text);
        match self.result {
            CheckResult::Passed if is_whole => Self { may_be_disturbed: false, text, ..self }.into_untested(),
            _ => Self { text, ..self },
        }
    }

    fn into_untested(self) -> Self {
        Self { result: CheckResult::Untested, ..self }
    }

    /// A judgement without figures.
    pub(super) fn new(passes: bool, text: String, unit: Unit) -> Self {
        let result = if passes { CheckResult::Passed } else { CheckResult::Failed };
        let (margin, relative_margin, worst_ns, latency_s, breach) = (None, None, None, None, None);
        let may_be_disturbed = true;
        Self { result, text, margin, relative_margin, unit, worst_ns, latency_s, breach, may_be_disturbed }
    }

    /// The share of a margin in its limit; none without a limit other than 0.
    pub(super) fn share(margin: f64, limit: f64) -> Option<f64> {
        (limit != 0.0 && margin.is_finite()).then(|| margin / limit.abs())
    }
}

/// A requirement of the scenario and what it comes to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RequirementFigures {
    /// Its name.
    pub name: String,
    /// The requirement of the user's own list that it shows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub id: Option<String>,
    /// What must hold, in words.
    pub must: String,
    /// Whether it does.
    pub result: CheckResult,
    /// The finding, in words.
    pub finding: String,
    /// Margin, moment and latency.
    #[serde(flatten)]
    pub figures: CheckFigures,
    /// The moment of the smallest margin, ns of the run's clock.
    pub worst_ns: Option<u64>,
    /// The first value beyond its limit; none where it passes.
    #[serde(skip)]
    pub breach: Option<Breach>,
    /// Whether the machine may have caused a failure, where the machine lost cycles.
    #[serde(skip)]
    pub may_be_disturbed: bool,
    /// Whether it is an event that `[expect]` names.
    #[serde(skip)]
    pub is_expected_event: bool,
    /// Whether it judges what the mechanism does, and not what a controller states of it.
    #[serde(skip)]
    pub is_truth: bool,
    /// The signal over time, for plots.
    #[serde(skip)]
    pub plot: Option<RequirementPlot>,
}

/// The signal of a requirement over time, in the unit in which it is shown.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RequirementPlot {
    /// The signal's name.
    pub signal: String,
    /// The signal's unit.
    pub unit: &'static str,
    /// The instant that the curve counts from, ns of the run's clock.
    pub began_ns: u64,
    /// Lowest and highest values, by seconds.
    pub curve: Curve,
    /// Its limits, on both sides of zero where the magnitude of a signed curve is judged; none of a range, which no level shows.
    pub limits: Vec<f64>,
    /// The statistic that was judged and where the curve shows it; none where each value was judged.
    pub found: Option<(&'static str, Vec<f64>)>,
}

/// Why a value of a requirement cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum Reason {
    /// A signal that does not exist; where it would be the controller's own, the controller may declare it yet.
    #[error(transparent)]
    Unknown(#[from] UnknownSignal),
    /// Wrong, whatever the controller declares.
    #[error("{0}")]
    Wrong(String),
}

impl Reason {
    pub(super) fn wrong(reason: impl Into<String>) -> Self {
        Self::Wrong(reason.into())
    }
}

impl From<String> for Reason {
    fn from(reason: String) -> Self {
        Self::Wrong(reason)
    }
}

/// A key of a requirement, and why its value is refused.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Refused {
    pub(super) key: &'static str,
    pub(super) reason: Reason,
}

impl Refused {
    pub(super) fn new(key: &'static str, reason: impl Into<String>) -> Self {
        Self { key, reason: Reason::wrong(reason) }
    }
}

/// Names the key whose value is refused.
pub(super) trait OfKey<T> {
    fn of_key(self, key: &'static str) -> Result<T, Refused>;
}

impl<T, R: Into<Reason>> OfKey<T> for Result<T, R> {
    fn of_key(self, key: &'static str) -> Result<T, Refused> {
        self.map_err(|reason| Refused { key, reason: reason.into() })
    }
}

/// Why a scenario's requirement, or an event that it expects, cannot be judged.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{of}: {reason}")]
pub struct RequirementError {
    /// The key in the scenario, such as `require.then`.
    pub key: &'static str,
    /// The number of the requirement in the list, from 0; none for an expected event.
    pub entry: Option<usize>,
    pub(super) of: String,
    pub(super) reason: String,
}
