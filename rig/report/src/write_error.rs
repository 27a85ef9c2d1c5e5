//! The error of every file that the report writes.

use std::io;
use std::path::{Path, PathBuf};

/// A file of the report could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The system's error.
    #[source]
    pub error: io::Error,
}

impl WriteError {
    /// For `map_err` after an operation on this file.
    pub(crate) fn for_file(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| Self { path: path.to_owned(), error }
    }
}
