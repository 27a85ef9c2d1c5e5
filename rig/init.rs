//! `masseter init`: a folder to start from. Its files are examples of the project.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use masseter_terminal::{Exit, result_line};

/// The scenario, as a path within the folder.
const SCENARIO: &str = "scenario.toml";
/// Path within the folder, content, and what a user needs to know about the file.
const FILES: [(&str, &str, &str); 3] = [
    (SCENARIO, include_str!("../examples/start.toml"), "the motion, a gain and the limits of a run"),
    ("jaw.csv", include_str!("../examples/jaw.csv"), "the motion, made up"),
    (
        ".github/workflows/masseter.yml",
        include_str!("../examples/workflow.yml"),
        "the run in CI; enter where Masseter's source is",
    ),
];

/// The arguments of `init`.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Example:\n  masseter init rig\n  masseter run rig/scenario.toml")]
pub(crate) struct InitArgs {
    /// New or empty folder
    folder: PathBuf,
}

/// Writes every file, and prints the next command.
pub(crate) fn init(InitArgs { folder }: &InitArgs) -> anyhow::Result<Exit> {
    refuse_content(folder)?;
    for (name, content, about) in FILES {
        let path = folder.join(name);
        write(&path, content).with_context(|| format!("cannot write {}", path.display()))?;
        result_line!("{}: {about}", path.display())?;
    }
    result_line!("next: masseter run {}", folder.join(SCENARIO).display())?;
    Ok(Exit::Passed)
}

/// Refuses a folder with anything in it.
fn refuse_content(folder: &Path) -> anyhow::Result<()> {
    match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| format!("cannot read the folder {}", folder.display())),
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => bail!(
                "{} is not empty, and init replaces nothing; name a new folder, such as {}",
                folder.display(),
                folder.join("rig").display()
            ),
        },
    }
}

/// Writes a new file, and the folders above it.
fn write(path: &Path, content: &str) -> std::io::Result<()> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    File::create_new(path)?.write_all(content.as_bytes())
}
