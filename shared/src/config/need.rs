//! What many values of a scenario need alike.

use super::ScenarioError;

/// Longest run, s.
const LONGEST_S: f64 = 86_400.0;

/// Refuses the first of `values` that is not a finite number above 0.
pub(super) fn require_positive(values: &[(&'static str, f64)]) -> Result<(), ScenarioError> {
    match values.iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
        Some(&(key, value)) => {
            let need = "use a finite number above 0".to_owned();
            Err(ScenarioError::BadValue { key, value: value.to_string(), need })
        }
        None => Ok(()),
    }
}

/// Refuses the first of `durations` (s) that is not above 0, or longer than a run may be.
pub(super) fn require_duration(durations: &[(&'static str, f64)]) -> Result<(), ScenarioError> {
    match durations.iter().find(|(_, duration_s)| !(*duration_s > 0.0 && *duration_s <= LONGEST_S)) {
        Some(&(key, duration_s)) => {
            let need = format!("use more than 0 and at most {LONGEST_S} s");
            Err(ScenarioError::BadValue { key, value: duration_s.to_string(), need })
        }
        None => Ok(()),
    }
}

/// Refuses the first of `values` outside of its two bounds, which belong to it, or not a number.
pub(super) fn require_within(values: &[(&'static str, f64, f64, f64)]) -> Result<(), ScenarioError> {
    match values.iter().find(|(_, value, least, most)| !(least..=most).contains(&value)) {
        Some(&(key, value, least, most)) => {
            let need = format!("use {least} to {most}");
            Err(ScenarioError::BadValue { key, value: value.to_string(), need })
        }
        None => Ok(()),
    }
}
