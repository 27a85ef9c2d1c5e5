//! The mark of an interrupted start of a campaign, a file in its folder. An engine may hold cases that it has not begun
//! yet, on other machines: whoever is about to run a case of that start, or runs one, stops at the mark. Another start
//! has another mark, so that it goes on while cases of the interrupted one still wait in a queue.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

/// The mark of one start, set or not.
#[derive(Debug)]
pub struct Interruption {
    path: PathBuf,
}

impl Interruption {
    /// That of the start with this number, in the folder of the campaign.
    pub(crate) fn of(folder: &Path, start: u64) -> Self {
        Self { path: folder.join(format!("interrupted-{start}")) }
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
}
