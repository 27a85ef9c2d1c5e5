//! The reasons for the refusal of a scenario, and the checks that many of its values share.

use std::path::{Path, PathBuf};
use std::{fmt::Display, ops::RangeInclusive};

use masseter_model::{geometry::AXIS_NAMES, section::Range};
use serde::Serialize;

use crate::input::{excerpt, read_text};
use crate::wording::shortest;

/// Longest run, s.
pub(super) const LONGEST_S: f64 = 86_400.0;

/// The reason for the refusal of a scenario.
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
        /// The key and its error, with the most similar valid key.
        reason: String,
    },
    /// An invalid value.
    #[error("{}{key} = {value}: {need}", place.as_ref().map(|place| format!("{place}: ")).unwrap_or_default())]
    BadValue {
        /// File, line and column, for a value of a file.
        place: Option<String>,
        /// The number of the table in a list of tables, from 0.
        entry: Option<usize>,
        /// The key, with its table.
        key: String,
        /// The given value.
        value: String,
        /// The valid values.
        need: String,
    },
}

impl ScenarioError {
    pub(super) fn bad(key: &str, value: &dyn Display, need: impl Display) -> Self {
        let value = excerpt(&value.to_string());
        Self::BadValue { place: None, entry: None, key: key.to_owned(), value, need: need.to_string() }
    }

    pub(super) fn malformed_file(path: &Path, reason: String) -> Self {
        Self::Malformed { place: path.display().to_string(), reason }
    }

    /// The refusal of a file that a key of this scenario names.
    pub(super) fn of_file_in(self, scenario: &Path, key: &str) -> Self {
        match self {
            Self::Unreadable { path, error } => {
                Self::malformed_file(scenario, format!("{key}: {}: {error}", path.display()))
            }
            other => other,
        }
    }

    /// The refusal with the key in this table.
    pub(super) fn in_table(mut self, table: &str) -> Self {
        if let Self::BadValue { key, .. } = &mut self {
            *key = format!("{table}.{key}");
        }
        self
    }

    /// The refusal with the number of the table in a list of tables.
    pub(super) fn of_entry(mut self, number: usize) -> Self {
        if let Self::BadValue { entry, .. } = &mut self {
            *entry = Some(number);
        }
        self
    }
}

/// The result of a check.
pub(super) type Checked = Result<(), ScenarioError>;

/// The text of a file of at most `most_bytes`.
pub(super) fn read_limited(path: &Path, most_bytes: u64) -> Result<String, ScenarioError> {
    read_text(path, most_bytes).map_err(|error| ScenarioError::Unreadable { path: path.to_owned(), error })
}

/// Refuses a value for a failed condition.
pub(super) fn require(is_good: bool, key: &str, value: &dyn Display, need: impl Display) -> Checked {
    if is_good { Ok(()) } else { Err(ScenarioError::bad(key, value, need)) }
}

/// Refuses a number out of a range.
pub(super) fn require_range(key: &str, range: Range, number: f64) -> Checked {
    if range.contains(number) {
        return Ok(());
    }
    Err(ScenarioError::bad(key, &shortest(number), format_args!("use {}", range.of_key(key))))
}

/// Refuses a number out of the declared range of its key, in this table.
pub(super) fn ranges_of(table: &str) -> impl Fn(&str, Range, f64) -> Checked {
    move |key, range, number| require_range(key, range, number).map_err(|error| error.in_table(table))
}

/// Requires the keys that an entry's kind needs, and refuses the keys that the kind neither needs nor takes. `keys` are
/// those of all kinds. A key counts as given where `entry` differs from `alone`, an entry with its kind only. `need_of`
/// gives the valid values of a missing key.
pub(super) fn require_keys<T: Serialize>(
    kind: &str,
    [needs, takes]: [&[&str]; 2],
    mut keys: impl Iterator<Item = &'static str>,
    [entry, alone]: [&T; 2],
    need_of: impl Fn(&str) -> String,
) -> Checked {
    let [entry, alone] =
        [entry, alone].map(|entry| serde_json::to_value(entry).expect("an entry has a JSON form"));
    keys.try_for_each(|key| match entry[key] != alone[key] {
        true if needs.contains(&key) || takes.contains(&key) => Ok(()),
        true => {
            let need = format_args!("leave it away: it has no effect on {kind}");
            Err(ScenarioError::bad(key, &"given", need))
        }
        false if needs.contains(&key) => Err(ScenarioError::bad(key, &"none", need_of(key))),
        false => Ok(()),
    })
}

/// Refuses names of no axis.
pub(super) fn require_axes(key: &str, names: &[String]) -> Checked {
    let unknown = names.iter().find(|name| !AXIS_NAMES.contains(&name.as_str()));
    let need = || format!("name axes: {}", AXIS_NAMES.join(", "));
    unknown.map_or(Ok(()), |name| Err(ScenarioError::bad(key, &format_args!("'{name}'"), need())))
}

/// Checks every entry of a list of tables. A refusal names the entry.
pub(super) fn require_each<T>(entries: &[T], mut check: impl FnMut(&T) -> Checked) -> Checked {
    let mut numbered = entries.iter().enumerate();
    numbered.try_for_each(|(number, entry)| check(entry).map_err(|error| error.of_entry(number)))
}

/// Refuses a text that is no word of this many letters, digits, '-' and '_'.
pub(super) fn require_word(key: &str, word: &str, length: RangeInclusive<usize>, need: &str) -> Checked {
    let is_good = |byte: u8| byte.is_ascii_alphanumeric() || byte == b'-' || byte == b'_';
    let is_word = length.contains(&word.len()) && word.bytes().all(is_good);
    require(is_word, key, &format_args!("'{word}'"), need)
}

/// Refuses a name that cannot be a part of a signal's name.
pub(super) fn require_name(key: &str, name: &str) -> Checked {
    let is_good = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    let is_name = (1..=64).contains(&name.len()) && name.bytes().all(is_good);
    require(is_name, key, &format_args!("'{name}'"), "use 1 to 64 lower-case letters, digits or '_'")
}
