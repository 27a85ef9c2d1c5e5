//! `masseter init`: a folder to start from. Its files are examples of the project.

use std::path::PathBuf;

use clap::Args;
use masseter_terminal::{Exit, result_line};

use crate::starter::{StarterFile, lay_down, quoted};

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
    lay_down(folder, &FILES.map(|(path, content, _)| StarterFile { path, content: content.to_owned() }))?;
    for (name, _, about) in FILES {
        result_line!("{}: {about}", folder.join(name).display())?;
    }
    result_line!("next: masseter run {}", quoted(&folder.join(SCENARIO)))?;
    Ok(Exit::Passed)
}
