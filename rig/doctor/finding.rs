//! What a check found.

use serde::Serialize;

/// How good or bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Level {
    /// As it should be.
    Ok,
    /// Runs work; their tail or their comfort suffers.
    Warn,
    /// Runs cannot be trusted to keep real time.
    Bad,
}

/// One line of the doctor's report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What was looked at.
    pub check: &'static str,
    /// How it is.
    pub level: Level,
    /// What was found.
    pub found: String,
    /// What it costs; none when all is well.
    pub cost: Option<String>,
    /// The command that mends it; none when all is well or nothing on this machine helps.
    pub mend: Option<String>,
}

impl Finding {
    /// All is well.
    pub fn ok(check: &'static str, found: impl Into<String>) -> Self {
        Self { check, level: Level::Ok, found: found.into(), cost: None, mend: None }
    }

    /// Something that costs.
    pub fn warn(check: &'static str, found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { check, level: Level::Warn, found: found.into(), cost: Some(cost.into()), mend: None }
    }

    /// Something that rules real time out.
    pub fn bad(check: &'static str, found: impl Into<String>, cost: impl Into<String>) -> Self {
        Self { level: Level::Bad, ..Self::warn(check, found, cost) }
    }

    /// The command that mends it.
    #[must_use]
    pub fn mended_by(self, command: impl Into<String>) -> Self {
        Self { mend: Some(command.into()), ..self }
    }
}
