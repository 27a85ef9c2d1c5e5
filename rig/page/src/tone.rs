//! Whether something is as it should be, as a colour.

use serde::Serialize;

/// Whether something is as it should be.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Tone {
    /// It is.
    Good,
    /// It may not be.
    Doubtful,
    /// It is not.
    Bad,
    /// It is not judged.
    Plain,
}
