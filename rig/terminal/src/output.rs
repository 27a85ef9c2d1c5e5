//! Files and folders that a command was told to make: taken before the work for them begins, and never what somebody
//! has already. What is written into them is not known here.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// Why a file or folder could not be made.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// It is there already.
    #[error("{} exists and is not overwritten; choose another --out", .0.display())]
    Exists(PathBuf),
    /// The system refused.
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
    /// What the system's answer about `path` means.
    pub fn creating(path: &Path) -> impl Fn(io::Error) -> Self {
        move |error| match error.kind() {
            ErrorKind::AlreadyExists => Self::Exists(path.to_owned()),
            _ => Self::Create { path: path.to_owned(), error },
        }
    }
}

/// A file that was not there before, empty.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_file(path: &Path) -> Result<File, OutputError> {
    File::create_new(path).map_err(OutputError::creating(path))
}

/// Makes a folder that was not there before, and those above it that are missing.
///
/// # Errors
/// When it exists, or the system refuses it.
pub fn new_folder(path: &Path) -> Result<(), OutputError> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|error| OutputError::Create { path: path.to_owned(), error })?;
    }
    fs::create_dir(path).map_err(OutputError::creating(path))
}
