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

/// Shortest motion, s: a hundred samples at 1 kHz.
pub(super) const SHORTEST_MOTION_S: f64 = 0.1;

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

/// Refuses a name that cannot be a part of a signal's.
pub(super) fn require_name(key: &'static str, name: &str) -> Result<(), ScenarioError> {
    let is_good = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    if !name.is_empty() && name.len() <= 64 && name.bytes().all(is_good) {
        return Ok(());
    }
    Err(ScenarioError::bad(key, &format!("'{name}'"), "use 1 to 64 lower-case letters, digits or '_'"))
}

/// Refuses a text that no report can show in a line.
pub(super) fn require_text(key: &'static str, text: &str) -> Result<(), ScenarioError> {
    if !text.trim().is_empty() && text.chars().count() <= 120 && !text.chars().any(char::is_control) {
        return Ok(());
    }
    Err(ScenarioError::bad(key, &format!("'{text}'"), "use 1 to 120 characters in one line"))
}
