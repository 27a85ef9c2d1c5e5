//! `[matrix]`: lists of values for keys of the scenario. Every combination of them is a case of a suite, with a name.

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::error::ScenarioError;

/// More cases of one scenario are a campaign.
const MOST_CASES: usize = 1000;

/// Keys of the scenario, each with its values, as given.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Matrix(Table);

/// A case of a matrix.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct MatrixCase {
    /// The last word of each key with its value, such as `rate_hz=500,axis=l2`.
    pub name: String,
    /// The values as [`Scenario::with`](crate::Scenario::with) takes them, each `KEY=VALUE`.
    pub assignments: Vec<String>,
}

impl Matrix {
    /// Every combination; the last key changes first. None without a key.
    ///
    /// # Errors
    /// [`ScenarioError::BadValue`] for a key without a list of values, or for too many combinations.
    pub fn cases(&self) -> Result<Vec<MatrixCase>, ScenarioError> {
        let mut keys = Vec::new();
        keys_within("", &self.0, &mut keys)?;
        let count = keys.iter().try_fold(1_usize, |count, (_, values)| count.checked_mul(values.len()));
        if count.is_none_or(|count| count > MOST_CASES) {
            let need = format!("use at most {MOST_CASES} combinations; a campaign takes more");
            return Err(ScenarioError::bad("matrix", &count.unwrap_or(usize::MAX), need));
        }
        let add = |cases: Vec<MatrixCase>, (key, values): &(String, &[Value])| {
            let of = |case: &MatrixCase| values.iter().map(|value| case.with(key, value)).collect::<Vec<_>>();
            cases.iter().flat_map(of).collect()
        };
        let none = vec![MatrixCase::default()];
        Ok(if keys.is_empty() { Vec::new() } else { keys.iter().fold(none, add) })
    }
}

impl MatrixCase {
    fn with(&self, key: &str, value: &Value) -> Self {
        let word = key.rsplit('.').next().unwrap_or(key);
        let shown = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let separator = if self.name.is_empty() { "" } else { "," };
        let name = format!("{}{separator}{word}={shown}", self.name);
        let assignments = self.assignments.iter().cloned().chain([format!("{key}={value}")]).collect();
        Self { name, assignments }
    }
}

/// The lists of a table and of the tables in it, each with its whole key.
fn keys_within<'a>(
    within: &str,
    table: &'a Table,
    found: &mut Vec<(String, &'a [Value])>,
) -> Result<(), ScenarioError> {
    for (key, value) in table {
        let key = if within.is_empty() { key.clone() } else { format!("{within}.{key}") };
        match value {
            Value::Table(inner) => keys_within(&key, inner, found)?,
            Value::Array(values) if (1..values.len()).any(|n| values[..n].contains(&values[n])) => {
                return Err(ScenarioError::bad("matrix", &key, "name each value once"));
            }
            Value::Array(values) if !values.is_empty() => found.push((key, values)),
            _ => {
                let need = "give each key a list of values, such as rate_hz = [500, 1000]";
                return Err(ScenarioError::bad("matrix", &key, need));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cases(text: &str) -> Result<Vec<MatrixCase>, String> {
        let matrix: Matrix = toml::from_str(text).unwrap();
        matrix.cases().map_err(|error| error.to_string())
    }

    #[test]
    fn every_combination_is_a_case_with_its_values_in_the_name() {
        let found = cases("faults.lose.bus = [0, 1]\nrate_hz = [500, 1000]").unwrap();
        let names: Vec<_> = found.iter().map(|case| case.name.as_str()).collect();
        assert_eq!(
            names,
            ["bus=0,rate_hz=500", "bus=0,rate_hz=1000", "bus=1,rate_hz=500", "bus=1,rate_hz=1000"]
        );
        assert_eq!(found[1].assignments, ["faults.lose.bus=0", "rate_hz=1000"]);
        let text = cases("'motion.kind' = ['opening']").unwrap();
        assert_eq!(
            (text[0].name.as_str(), text[0].assignments[0].as_str()),
            ("kind=opening", "motion.kind=\"opening\"")
        );
        assert_eq!(cases("").unwrap(), []);
    }

    #[test]
    fn a_key_without_a_list_and_too_many_cases_are_refused() {
        for text in ["rate_hz = 500", "rate_hz = []", "controller.lead_cycles = 2.0"] {
            assert!(cases(text).unwrap_err().contains("give each key a list of values"), "{text}");
        }
        assert!(cases("seed = [1, 1]").unwrap_err().contains("name each value once"));
        let tens =
            ["a", "b", "c", "d"].map(|key| key.to_owned() + " = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]\n").concat();
        assert!(cases(&tens).unwrap_err().contains("matrix = 10000: use at most 1000"));
    }
}
