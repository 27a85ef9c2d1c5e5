//! The lines of a file or of standard input.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use anyhow::Context;
use masseter_scenario::rows::{Line, lines};

/// The input with its name in messages.
pub(super) struct Input {
    pub name: String,
    pub lines: Box<dyn Iterator<Item = Line>>,
}

impl Input {
    /// Opens a file, or standard input.
    pub(super) fn open(path: Option<&Path>) -> anyhow::Result<Self> {
        let Some(path) = path else {
            let lines = Box::new(lines(io::stdin().lock()));
            return Ok(Self { name: "standard input".to_owned(), lines });
        };
        let name = path.display().to_string();
        let file = File::open(path).with_context(|| format!("cannot read {name}"))?;
        Ok(Self { name, lines: Box::new(lines(BufReader::new(file))) })
    }
}
