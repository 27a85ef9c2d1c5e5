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
    for (index, (name, content, _)) in FILES.iter().enumerate() {
        let path = folder.join(name);
        if let Err(error) = write(&path, content) {
            // So that the same command can be given again.
            FILES[..=index].iter().for_each(|(name, ..)| drop(fs::remove_file(folder.join(name))));
            return Err(error).with_context(|| format!("cannot write {}", path.display()));
        }
    }
    for (name, _, about) in FILES {
        result_line!("{}: {about}", folder.join(name).display())?;
    }
    result_line!("next: masseter run {}", quoted(&folder.join(SCENARIO)))?;
    Ok(Exit::Passed)
}

/// A path as a shell takes it for one word that is no option.
fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let text = if text.starts_with('-') { format!("./{text}") } else { text };
    let is_plain = |character: char| character.is_alphanumeric() || "/._-+,:@%".contains(character);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_command_is_one_that_a_shell_runs() {
        for (path, expected) in [
            ("rig/scenario.toml", "rig/scenario.toml"),
            ("my rig; rm -x/s.toml", "'my rig; rm -x/s.toml'"),
            ("it's/s.toml", "'it'\\''s/s.toml'"),
            ("-dash/s.toml", "./-dash/s.toml"),
        ] {
            assert_eq!(quoted(Path::new(path)), expected);
        }
    }
}
