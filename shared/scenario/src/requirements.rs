//! Requirements of a run: `[[require]]`.
//!
//! This module holds what is written. Signals, conditions and their units are resolved and judged by the crate
//! `masseter-analysis`.

use serde::{Deserialize, Serialize};

use super::error::ScenarioError;
use super::need::require_text;
use super::quantity::Quantity;

/// When a requirement is judged.
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

/// What of a signal is held against the bounds.
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

/// One requirement: bounds of a signal, a response, a condition that must never hold, a number of occurrences, or their
/// order.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RequirementConfig {
    /// Its name in reports.
    pub name: String,
    /// Bounds: the signal.
    pub signal: Option<String>,
    /// Bounds: an expression of signals in SI units, instead of a signal.
    pub expression: Option<String>,
    /// Unit of the expression.
    pub unit: Option<String>,
    /// When it is judged; the whole run when absent.
    pub during: Option<During>,
    /// Bounds: what of the signal.
    pub statistic: Statistic,
    /// Bounds: the percentile, 0 to 100.
    pub percentile: Option<f64>,
    /// Bounds: the smallest allowed value.
    pub min: Option<Quantity>,
    /// Bounds: the largest allowed value.
    pub max: Option<Quantity>,
    /// Response: the trigger.
    pub when: Option<String>,
    /// Response: the condition that must follow.
    pub then: Option<String>,
    /// Response: not before so long after the trigger.
    pub delay: Option<Quantity>,
    /// Response: at the latest so long after the trigger.
    pub within: Option<Quantity>,
    /// Response: holds for so long.
    pub stays_for: Option<Quantity>,
    /// The condition that must never hold.
    pub never: Option<String>,
    /// Count: the occurrence.
    pub event: Option<String>,
    /// Count: the smallest allowed number.
    pub at_least: Option<u64>,
    /// Count: the largest allowed number.
    pub at_most: Option<u64>,
    /// Occurrences whose first ones must come in this order.
    pub order: Vec<String>,
}

impl RequirementConfig {
    pub(super) fn validate(&self) -> Result<(), ScenarioError> {
        require_text("require.name", &self.name)
    }
}
