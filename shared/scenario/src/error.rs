//! Why a scenario is refused, and the checks that many of its values share.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use crate::input::{excerpt, read_text};

/// Longest run, s.
pub(super) const LONGEST_S: f64 = 86_400.0;

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
    pub(super) fn bad(key: &'static str, value: &dyn Display, need: impl Display) -> Self {
        let value = excerpt(&value.to_string());
        Self::BadValue { place: None, entry: None, key, value, need: need.to_string() }
    }

    pub(super) fn malformed_file(path: &Path, reason: String) -> Self {
        Self::Malformed { place: path.display().to_string(), reason }
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

/// What a check leads to.
pub(super) type Checked = Result<(), ScenarioError>;

/// The text of a file of at most `most_bytes`.
pub(super) fn read_limited(path: &Path, most_bytes: u64) -> Result<String, ScenarioError> {
    read_text(path, most_bytes).map_err(|error| ScenarioError::Unreadable { path: path.to_owned(), error })
}

/// The values of a table, each with its whole key.
macro_rules! keyed {
    ($table:literal, $config:expr, $($field:ident)+) => {
        [$((concat!($table, ".", stringify!($field)), f64::from($config.$field))),+]
    };
}

/// The values of a table, each with its whole key, its least and its greatest value.
macro_rules! bounded {
    ($table:literal, $config:expr, $($field:ident [$least:expr, $most:expr])+) => {
        [$((concat!($table, ".", stringify!($field)), $config.$field, $least, $most)),+]
    };
}
pub(super) use {bounded, keyed};

/// Refuses a value that is not good.
pub(super) fn require(is_good: bool, key: &'static str, value: &dyn Display, need: impl Display) -> Checked {
    if is_good { Ok(()) } else { Err(ScenarioError::bad(key, value, need)) }
}

/// Refuses the first of `values` that is not a finite number above 0.
pub(super) fn require_positive(values: &[(&'static str, f64)]) -> Checked {
    values.iter().try_for_each(|&(key, value)| {
        require(value.is_finite() && value > 0.0, key, &value, "use a finite number above 0")
    })
}

/// Refuses a value that is not a finite number, or below 0.
pub(super) fn require_not_negative(key: &'static str, value: f64) -> Checked {
    require(value.is_finite() && value >= 0.0, key, &value, "use a finite number not below 0")
}

/// Refuses the first of `durations` (s) that is not above 0, or longer than a run may be.
pub(super) fn require_duration(durations: &[(&'static str, f64)]) -> Checked {
    durations.iter().try_for_each(|&(key, duration_s)| {
        let is_good = duration_s > 0.0 && duration_s <= LONGEST_S;
        require(is_good, key, &duration_s, format_args!("use more than 0 and at most {LONGEST_S} s"))
    })
}

/// Refuses the first of `values` outside of its two bounds, or not a number. Each value comes with its bounds.
pub(super) fn require_within(values: &[(&'static str, f64, f64, f64)]) -> Checked {
    values.iter().try_for_each(|&(key, value, least, most)| {
        require((least..=most).contains(&value), key, &value, format_args!("use {least} to {most}"))
    })
}

/// Refuses keys of a table that its kind neither needs nor takes, and requires those that it needs. Each key comes with
/// whether it is given; `need_of` says what a missing one must say.
pub(super) fn require_keys(
    kind: &str,
    [needs, takes]: [&[&str]; 2],
    given: &[(&'static str, bool)],
    need_of: impl Fn(&str) -> String,
) -> Checked {
    given.iter().try_for_each(|&(key, is_given)| {
        let has = |names: &[&str]| names.iter().any(|name| key.rsplit('.').next() == Some(name));
        let need = format_args!("leave it away: it has no effect on {kind}");
        require(!is_given || has(needs) || has(takes), key, &"given", need)?;
        if is_given || !has(needs) { Ok(()) } else { Err(ScenarioError::bad(key, &"none", need_of(key))) }
    })
}

/// Checks every entry of a list of tables. A refusal names the entry.
pub(super) fn require_each<T>(entries: &[T], mut check: impl FnMut(&T) -> Checked) -> Checked {
    let mut numbered = entries.iter().enumerate();
    numbered.try_for_each(|(number, entry)| check(entry).map_err(|error| error.of_entry(number)))
}

/// Refuses a name that cannot be a part of a signal's.
pub(super) fn require_name(key: &'static str, name: &str) -> Checked {
    let is_good = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_';
    let is_name = (1..=64).contains(&name.len()) && name.bytes().all(is_good);
    require(is_name, key, &format_args!("'{name}'"), "use 1 to 64 lower-case letters, digits or '_'")
}
