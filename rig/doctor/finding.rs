//! The finding of a check.

use serde::Serialize;

/// How a finding affects real-time runs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Level {
    /// No effect.
    Ok,
    /// Runs work with longer latencies or fewer features.
    Warn,
    /// Runs cannot be trusted to meet their deadlines.
    Bad,
}

/// An entry of the doctor's report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(super) struct Finding {
    /// The name of the check.
    pub check: &'static str,
    /// Its level.
    pub level: Level,
    /// The state of the machine.
    pub found: String,
    /// The effect on runs; none at level `ok`.
    pub cost: Option<String>,
    /// The command that improves it; none at level `ok`, or where no command helps.
    pub remedy: Option<String>,
}

impl Finding {
    /// A finding without effect.
    pub(super) fn ok(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, level: Level::Ok, found: found.into(), cost: None, remedy: None }
    }

    /// A finding that degrades runs.
    pub(super) fn warn(check: &'static str, found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { check, level: Level::Warn, found: found.into(), cost: Some(cost.into()), remedy: None }
    }

    /// A finding that rules real time out.
    pub(super) fn bad(check: &'static str, found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { level: Level::Bad, ..Self::warn(check, found, cost) }
    }

    /// Adds the command that improves it.
    #[must_use]
    pub(super) fn with_remedy(self, command: impl Into<String>) -> Self {
        Self { remedy: Some(command.into()), ..self }
    }
}
