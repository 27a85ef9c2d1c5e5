//! The scenarios of a suite: found, named and chosen.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};

/// A scenario of a suite.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Case {
    /// Its name in the suite: that of its file, or its path where two files have one name.
    pub(super) name: String,
    /// Its file.
    pub(super) path: PathBuf,
}

/// The scenarios of a command line.
#[derive(Debug)]
pub(super) struct Cases {
    /// Those that run.
    pub(super) chosen: Vec<Case>,
    /// The number of the others.
    pub(super) filtered_out: usize,
}

impl Cases {
    /// Finds the scenarios of folders and files, and chooses those with this text in their names.
    ///
    /// # Errors
    /// When a folder or file does not exist, or nothing is left to run.
    pub(super) fn find(paths: &[PathBuf], filter: Option<&str>) -> anyhow::Result<Self> {
        let mut files = Vec::new();
        for path in paths {
            files.extend(files_of(path)?);
        }
        // A folder may be named beside one of its files.
        let mut seen = BTreeSet::new();
        files.retain(|file| seen.insert(located(file)));
        let all = named(files);
        let (chosen, others): (Vec<_>, Vec<_>) =
            all.into_iter().partition(|case| filter.is_none_or(|text| case.name.contains(text)));
        if let (true, Some(text)) = (chosen.is_empty(), filter) {
            let names: Vec<_> = others.iter().map(|case| case.name.as_str()).collect();
            bail!("no scenario has '{text}' in its name; there are: {}", names.join(", "));
        }
        Ok(Self { chosen, filtered_out: others.len() })
    }
}

/// A file by the one name of its folder. The file may be a link, and its folder has the files that it names.
fn located(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(file.file_name().unwrap_or_default())
}

/// The scenarios of a folder in the order of their names, or a file itself.
fn files_of(path: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let unread = || format!("cannot read {}", path.display());
    if fs::metadata(path).with_context(unread)?.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries: Vec<_> = fs::read_dir(path).and_then(Iterator::collect).with_context(unread)?;
    let entries = entries.into_iter().map(|entry: fs::DirEntry| entry.path());
    let is_scenario = |file: &PathBuf| file.extension().is_some_and(|name| name == "toml") && file.is_file();
    let mut files: Vec<_> = entries.filter(is_scenario).collect();
    files.sort();
    ensure!(!files.is_empty(), "{} has no scenario: put *.toml files into it", path.display());
    Ok(files)
}

fn named(files: Vec<PathBuf>) -> Vec<Case> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for path in &files {
        *times.entry(stem(path)).or_default() += 1;
    }
    let name = |path: &Path| match stem(path) {
        stem if times[&stem] == 1 => stem,
        _ => path.with_extension("").display().to_string(),
    };
    files.into_iter().map(|path| Case { name: name(&path), path }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_with_one_name_go_by_their_paths() {
        let names = |paths: &[&str]| {
            let cases = named(paths.iter().map(PathBuf::from).collect());
            cases.into_iter().map(|case| case.name).collect::<Vec<_>>()
        };
        assert_eq!(names(&["a/one.toml", "b/two.toml"]), ["one", "two"]);
        assert_eq!(names(&["a/one.toml", "b/one.toml", "b/two.toml"]), ["a/one", "b/one", "two"]);
    }
}
