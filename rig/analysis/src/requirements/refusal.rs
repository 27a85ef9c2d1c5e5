//! Why a requirement cannot be judged.

use crate::signals::UnknownSignal;

/// Why a value of a requirement cannot be read.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(super) enum Reason {
    /// A signal that does not exist; where it would be the controller's own, the controller may declare it yet.
    #[error(transparent)]
    Unknown(#[from] UnknownSignal),
    /// Wrong, whatever the controller declares.
    #[error("{0}")]
    Wrong(String),
}

impl From<String> for Reason {
    fn from(reason: String) -> Self {
        Self::Wrong(reason)
    }
}

/// A key of a requirement, and why its value is refused.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Refused {
    pub(super) key: &'static str,
    pub(super) reason: Reason,
}

impl Refused {
    pub(super) fn new(key: &'static str, reason: impl Into<String>) -> Self {
        Self { key, reason: Reason::Wrong(reason.into()) }
    }
}

/// Names the key whose value is refused.
pub(super) trait OfKey<T> {
    fn of_key(self, key: &'static str) -> Result<T, Refused>;
}

impl<T, R: Into<Reason>> OfKey<T> for Result<T, R> {
    fn of_key(self, key: &'static str) -> Result<T, Refused> {
        self.map_err(|reason| Refused { key, reason: reason.into() })
    }
}

/// Why a scenario's requirement, or an event that it expects, cannot be judged.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{of}: {reason}")]
pub struct RequirementError {
    /// The key in the scenario, such as `require.then`.
    pub key: &'static str,
    /// The number of the requirement in the list, from 0; none for an expected event.
    pub entry: Option<usize>,
    pub(super) of: String,
    pub(super) reason: String,
}
