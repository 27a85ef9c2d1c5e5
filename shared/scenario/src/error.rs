//! Why a scenario is refused.

use std::fmt;
use std::path::PathBuf;

use crate::input::excerpt;

/// Why a scenario was refused.
#[derive(Debug, thiserror::Error)]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{}: {error}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        error: std::io::Error,
    },
    /// The text is not TOML, has an unknown key, or a value of the wrong type.
    #[error("{place}: {reason}")]
    Malformed {
        /// File, line and column.
        place: String,
        /// The key and its error, with the most similar valid one.
        reason: String,
    },
    /// An invalid value.
    #[error("{}{key} = {value}: {need}", place.as_ref().map(|place| format!("{place}: ")).unwrap_or_default())]
    BadValue {
        /// File, line and column, if the value stands in a file.
        place: Option<String>,
        /// The number of the table in a list of tables, from 0.
        entry: Option<usize>,
        /// The key, with its table.
        key: &'static str,
        /// The given value.
        value: String,
        /// The valid values.
        need: String,
    },
}

impl ScenarioError {
    pub(super) fn bad(key: &'static str, value: &dyn fmt::Display, need: impl Into<String>) -> Self {
        let value = excerpt(&value.to_string());
        Self::BadValue { place: None, entry: None, key, value, need: need.into() }
    }

    /// The same of a table that has the keys of another one.
    pub(super) fn of_table(mut self, table: &str) -> Self {
        if let Self::BadValue { need, .. } = &mut self {
            *need = format!("{need}; the value is that of [{table}]");
        }
        self
    }

    /// The same of a table in a list of tables.
    pub(super) fn of_entry(mut self, number: usize) -> Self {
        if let Self::BadValue { entry, .. } = &mut self {
            *entry = Some(number);
        }
        self
    }
}
