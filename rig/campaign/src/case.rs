//! A case: a whole scenario with its number, its identity and the values of its factors.

use masseter_scenario::Scenario;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// The value of a factor in a case.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// Name of the factor.
    pub name: String,
    /// The key of the scenario; none for a fault.
    pub key: Option<String>,
    /// The value of the key; none for a fault.
    pub value: Option<Value>,
    /// The fault that is added; none where nothing is.
    pub fault: Option<Table>,
}

impl Setting {
    pub(crate) fn key(name: &str, key: &str, value: Value) -> Self {
        Self { name: name.to_owned(), key: Some(key.to_owned()), value: Some(value), fault: None }
    }

    pub(crate) fn fault(name: &str, fault: Option<Table>) -> Self {
        Self { name: name.to_owned(), key: None, value: None, fault }
    }

    /// The value as a number, without its unit; none of one that is no number.
    pub fn number(&self) -> Option<f64> {
        match self.value.as_ref()? {
            Value::Float(number) => Some(*number),
            Value::Integer(whole) => Some(*whole as f64),
            Value::Boolean(is_true) => Some(f64::from(u8::from(*is_true))),
            Value::String(text) => text.split_whitespace().next()?.parse().ok(),
            _ => None,
        }
    }

    /// The value in a word: that of a table is its name or kind.
    pub fn word(&self) -> String {
        let of_table = |table: &Table| {
            let named = ["name", "kind"].into_iter().find_map(|key| table.get(key)?.as_str());
            named.map_or_else(|| table.to_string().replace('\n', " "), str::to_owned)
        };
        match &self.value {
            Some(Value::Table(table)) => of_table(table),
            Some(Value::String(text)) => text.clone(),
            Some(value) => value.to_string(),
            None => self.fault.as_ref().map_or_else(|| "none".to_owned(), of_table),
        }
    }

    /// Enters the value into a scenario's table of changes.
    pub(crate) fn enter(&self, changes: &mut Table) {
        let (Some(key), Some(value)) = (&self.key, &self.value) else { return };
        let (folders, name) =
            key.rsplit_once('.').map_or(("", key.as_str()), |(folders, name)| (folders, name));
        let folders = folders.split('.').filter(|name| !name.is_empty());
        let inner = folders.fold(changes, |table, name| {
            let entry = table.entry(name).or_insert_with(|| Value::Table(Table::new()));
            if !entry.is_table() {
                // Another factor gives the whole table as something else; the later factor counts.
                *entry = Value::Table(Table::new());
            }
            entry.as_table_mut().expect("it is one now")
        });
        inner.insert(name.to_owned(), value.clone());
    }
}

/// A run of a campaign.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Its place in the campaign, from 0.
    pub number: usize,
    /// Twelve hexadecimal digits for everything that the result depends on.
    pub id: String,
    /// The values of the factors.
    pub settings: Vec<Setting>,
    /// What is added to the seed of the scenario.
    pub more_seed: u64,
    /// The scenario, or why the values lead to none.
    pub scenario: Result<Scenario, String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_share_the_tables_of_their_keys() {
        let mut changes = Table::new();
        for (key, value) in [("a.b.c", 1), ("a.b.d", 2), ("e", 3)] {
            Setting::key(key, key, Value::Integer(value)).enter(&mut changes);
        }
        let wanted: Table = toml::from_str("e = 3\n[a.b]\nc = 1\nd = 2").unwrap();
        assert_eq!(changes, wanted);
    }

    #[test]
    fn a_value_has_a_number_and_a_word() {
        let of = |value: Value| Setting::key("x", "x", value);
        assert_eq!(of(Value::from("1.5 mm")).number(), Some(1.5));
        assert_eq!(of(Value::from("chewing")).number(), None);
        assert_eq!(of(Value::Boolean(true)).number(), Some(1.0));
        let motion: Table = toml::from_str("kind = 'opening'").unwrap();
        assert_eq!(of(Value::Table(motion.clone())).word(), "opening");
        assert_eq!(Setting::fault("fault", Some(motion)).word(), "opening");
        assert_eq!(Setting::fault("fault", None).word(), "none");
    }
}
