//! Folders to start from: files are written into a new or empty folder, and nothing is replaced.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// A file of such a folder: its path within, and its content.
pub(crate) struct StarterFile {
    pub(crate) path: &'static str,
    pub(crate) content: String,
}

/// Writes every file, or none.
pub(crate) fn lay_down(folder: &Path, files: &[StarterFile]) -> anyhow::Result<()> {
    refuse_content(folder)?;
    for (index, StarterFile { path, content }) in files.iter().enumerate() {
        let path = folder.join(path);
        if let Err(error) = write(&path, content) {
            // So that the same command can be given again.
            files[..=index].iter().for_each(|file| drop(fs::remove_file(folder.join(file.path))));
            return Err(error).with_context(|| format!("cannot write {}", path.display()));
        }
    }
    Ok(())
}

/// Refuses a folder with anything in it.
fn refuse_content(folder: &Path) -> anyhow::Result<()> {
    match fs::read_dir(folder) {
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(error).with_context(|| format!("cannot read the folder {}", folder.display())),
        Ok(mut entries) => match entries.next() {
            None => Ok(()),
            Some(_) => bail!("{} is not empty, and nothing is replaced; name a new folder", folder.display()),
        },
    }
}

/// Writes a new file, and the folders above it.
fn write(path: &Path, content: &str) -> std::io::Result<()> {
    path.parent().map_or(Ok(()), fs::create_dir_all)?;
    File::create_new(path)?.write_all(content.as_bytes())
}

/// A path as a shell takes it for one word that is no option.
pub(crate) fn quoted(path: &Path) -> String {
    let text = path.display().to_string();
    let text = if text.starts_with('-') { format!("./{text}") } else { text };
    let is_plain = |character: char| character.is_alphanumeric() || "/._-+,:@%".contains(character);
    if text.chars().all(is_plain) { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// A path as a program in this folder: a shell searches PATH for a name alone.
pub(crate) fn as_program(path: &Path) -> PathBuf {
    if path.is_absolute() { path.to_owned() } else { Path::new(".").join(path) }
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
