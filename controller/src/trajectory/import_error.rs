//! Why a recorded motion cannot be used: file, line, problem and remedy.

use std::fmt;
use std::path::PathBuf;

/// A place in a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceLine {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1.
    pub line: u64,
}

impl fmt::Display for SourceLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}", self.path.display(), self.line)
    }
}

/// A recording that cannot be used: where, why, and what helps.
#[derive(Debug, thiserror::Error)]
#[error("{}{}: {problem}", path.display(), line.map_or_else(String::new, |line| format!(":{line}")))]
pub struct ImportError {
    /// The file.
    pub path: PathBuf,
    /// The line, from 1; none where the file as a whole is at fault.
    pub line: Option<u64>,
    /// What is wrong, with its remedy: for the person who corrects the file.
    pub problem: String,
}

/// A problem with its line, before the path is known.
#[derive(Debug)]
pub(super) struct Located {
    pub line: Option<u64>,
    pub problem: String,
}

impl Located {
    pub(super) fn at(line: u64, problem: String) -> Self {
        Self { line: Some(line), problem }
    }

    pub(super) fn whole(problem: String) -> Self {
        Self { line: None, problem }
    }
}
