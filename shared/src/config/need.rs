//! Checks that many values of a scenario share.

use super::error::ScenarioError;

/// The values of a table, each with its whole key.
macro_rules! keyed {
    ($table:literal, $config:expr, $($field:ident)+) => {
        [$((concat!($table, ".", stringify!($field)), f64::from($config.$field))),+]
    };
}
pub(super) use keyed;

/// Longest run, s.
pub(super) const LONGEST_S: f64 = 86_400.0;

/// Refuses the first of `values` that is not a finite number above 0.
pub(super) fn require_positive(values: &[(&'static str, f64)]) -> Result<(), ScenarioError> {
    require(values, |value| value.is_finite() && value > 0.0, "use a finite number above 0")
}

/// Refuses the first of `values` that is not a finite number, or below 0.
pub(super) fn require_not_negative(values: &[(&'static str, f64)]) -> Result<(), ScenarioError> {
    require(values, |value| value.is_finite() && value >= 0.0, "use a finite number not below 0")
}

/// Refuses the first of `durations` (s) that is not above 0, or longer than a run may be.
pub(super) fn require_duration(durations: &[(&'static str, f64)]) -> Result<(), ScenarioError> {
    let need = format!("use more than 0 and at most {LONGEST_S} s");
    require(durations, |duration_s| duration_s > 0.0 && duration_s <= LONGEST_S, &need)
}

/// Refuses the first of `values` outside of its two bounds, or not a number. Each value comes with its bounds.
pub(super) fn require_within(values: &[(&'static str, f64, f64, f64)]) -> Result<(), ScenarioError> {
    values.iter().try_for_each(|&(key, value, least, most)| {
        let need = format!("use {least} to {most}");
        require(&[(key, value)], |value| (least..=most).contains(&value), &need)
    })
}

fn require(
    values: &[(&'static str, f64)],
    is_good: impl Fn(f64) -> bool,
    need: &str,
) -> Result<(), ScenarioError> {
    match values.iter().find(|(_, value)| !is_good(*value)) {
        Some((key, value)) => Err(ScenarioError::bad(key, value, need)),
        None => Ok(()),
    }
}
