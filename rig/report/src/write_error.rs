//! The error of every file that the report writes.

use std::io::{self, ErrorKind};
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

    /// Whether the folder takes no files, as an archive does.
    pub(crate) fn is_read_only(&self) -> bool {
        matches!(self.error.kind(), ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem)
    }
}
