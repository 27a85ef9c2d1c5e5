//! New files and folders for the output of a command. Existing ones are never overwritten. Commands create them before
//! they compute.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Why a file or folder cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It exists.
    #[error("{} exists and is not overwritten; choose another --out", .0.display())]
    Exists(PathBuf),
    /// The system refused to create it.
    #[error("cannot create {}: {error}", path.display())]
    Create {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        #[source]
        error: io::Error,
    },
}

impl OutputError {
    /// Converts the system's error for `path`.
    pub fn creating(path: &Path) -> impl Fn(io::Error) -> Self {
        move |error| match error.kind() {
            ErrorKind::AlreadyExists => Self::Exists(path.to_owned()),
            _ => Self::Create { path: path.to_owned(), error },
        }
    }
}

/// Creates an empty file.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_file(path: &Path) -> Result<File, OutputError> {
    File::create_new(path).map_err(OutputError::creating(path))
}

/// Creates a folder, and missing folders above it.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_folder(path: &Path) -> Result<(), OutputError> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| OutputError::Create { path: path.to_owned(), error })?;
    }
    fs::create_dir(path).map_err(OutputError::creating(path))
}
