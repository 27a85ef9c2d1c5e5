//! The mark of an interrupted campaign in its folder. Engines may hold cases that they have not started yet, on other machines:
//! whoever is about to run a case, or runs one, stops at the mark.

use std::fs::{self, File};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

const MARK: &str = "interrupted";

/// The mark, set or not.
#[derive(Debug)]
pub struct Interruption {
    path: PathBuf,
}

impl Interruption {
    /// That of the campaign in this folder.
    pub(crate) fn of(folder: &Path) -> Self {
        Self { path: folder.join(MARK) }
    }

    /// Sets the mark.
    ///
    /// # Errors
    /// When the file cannot be made.
    pub fn mark(&self) -> io::Result<()> {
        File::create(&self.path).map(drop)
    }

    /// Whether the mark is set.
    pub fn is_marked(&self) -> bool {
        self.path.exists()
    }

    /// The campaign goes on.
    pub(crate) fn clear(&self) -> io::Result<()> {
        match fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }
}
