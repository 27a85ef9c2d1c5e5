//! Why a scenario is refused.

use std::fmt;
use std::path::PathBuf;

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
    #[error("{}:{line}: {reason}", path.display())]
    Malformed {
        /// The file.
        path: PathBuf,
        /// Line of the fault, from 1.
        line: usize,
        /// The error, with the most similar key.
        reason: String,
    },
    /// An invalid value.
    #[error("{key} = {value}: {need}")]
    BadValue {
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
        Self::BadValue { key, value: value.to_string(), need: need.into() }
    }
}
