//! The scenarios of a suite: found in folders, one for each combination of a matrix, named, chosen and shared.

use std::collections::{BTreeMap, BTreeSet};

use masseter_scenario::MatrixCase;

use super::choice::{Choice, Shard};
use crate::prelude::*;
use crate::run::needs_processes;
use crate::run::runner::ScenarioFile;

/// A scenario of a suite.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Case {
    /// Its name in the suite: that of its file, or its path where two files have one name; with the values of a matrix.
    pub(crate) name: String,
    /// Its file.
    pub(crate) path: PathBuf,
    /// Its values of a matrix, each as `KEY=VALUE`.
    pub(crate) set: Vec<String>,
    pub(crate) tags: Vec<String>,
    /// Whether its file cannot be read. Its tags are unknown then.
    is_unread: bool,
    /// Whether it cannot run in one thread.
    pub(crate) needs_processes: bool,
}

impl Case {
    pub(crate) fn file(&self) -> ScenarioFile<'_> {
        ScenarioFile { path: &self.path, set: &self.set }
    }
}

/// Which scenarios of a suite run.
#[derive(Debug, Clone, Default, Args)]
pub(crate) struct Selection {
    /// Run only the scenarios with these words in their names or as tags, joined by and, or, not and parentheses
    #[arg(short = 'k', long = "filter", value_name = "EXPRESSION")]
    pub(crate) choice: Option<Choice>,
    /// Run only the scenarios with this tag; of several, with any of them
    #[arg(long = "tag", value_name = "TAG")]
    pub(crate) tags: Vec<String>,
    /// Run only this share of the scenarios, such as 2/5, on one of five machines
    #[arg(long, value_name = "NUMBER/OF")]
    pub(crate) shard: Option<Shard>,
}

impl Selection {
    fn has(&self, case: &Case) -> bool {
        let is_any = self.tags.is_empty() || case.is_unread;
        let has_tag = is_any || self.tags.iter().any(|tag| case.tags.contains(tag));
        has_tag && self.choice.as_ref().is_none_or(|choice| choice.holds(&case.name, &case.tags))
    }
}

/// The scenarios of a command line.
#[derive(Debug)]
pub(crate) struct Cases {
    /// Those that run.
    pub(crate) chosen: Vec<Case>,
    /// The number of the others.
    pub(crate) filtered_out: usize,
    /// What of the folders looks like a scenario and does not run, each with the reason.
    pub(crate) left_out: Vec<String>,
}

impl Cases {
    /// Finds the scenarios of folders and files, and chooses among them.
    ///
    /// # Errors
    /// When a folder or file does not exist, or nothing is left to run.
    pub(crate) fn find(paths: &[PathBuf], selection: &Selection) -> anyhow::Result<Self> {
        let (mut files, mut left_out) = (Vec::new(), Vec::new());
        for path in paths {
            files.extend(files_of(path, &mut left_out)?);
        }
        // A folder may be named beside one of its files.
        let mut seen = BTreeSet::new();
        files.retain(|file| seen.insert(located(file)));
        let all: Vec<_> = named(files).into_iter().flat_map(|(name, path)| cases_of(&name, &path)).collect();
        let count = all.len();
        let names: Vec<_> = all.iter().map(|case| case.name.clone()).collect();
        let (mut chosen, others): (Vec<_>, Vec<_>) = all.into_iter().partition(|case| selection.has(case));
        let unread = others.iter().filter(|case| case.is_unread);
        left_out.extend(
            unread.map(|case| format!("{} (it cannot be read: its tags are unknown)", case.path.display())),
        );
        if chosen.is_empty() {
            bail!("no scenario is chosen by name and tag; there are: {}", names.join(", "));
        }
        if let Some(shard) = selection.shard {
            ensure!(
                shard.of <= chosen.len(),
                "--shard: {} scenarios have no {} shares",
                chosen.len(),
                shard.of
            );
            let mut places = 0..;
            chosen.retain(|_| places.next().is_some_and(|place| shard.has(place)));
        }
        Ok(Self { filtered_out: count - chosen.len(), chosen, left_out })
    }
}

/// A file by the one name of its folder. The file may be a link, and its folder has the files that it names.
fn located(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned()).join(file.file_name().unwrap_or_default())
}

/// The scenarios of a folder in the order of their names, or a file itself.
fn files_of(path: &Path, left_out: &mut Vec<String>) -> anyhow::Result<Vec<PathBuf>> {
    let unread = || format!("cannot read {}", path.display());
    if fs::metadata(path).with_context(unread)?.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let entries: Vec<_> = fs::read_dir(path).and_then(Iterator::collect).with_context(unread)?;
    let mut entries: Vec<_> = entries.into_iter().map(|entry: fs::DirEntry| entry.path()).collect();
    entries.sort();
    let mut files = Vec::new();
    for file in entries {
        match reason_against(&file) {
            None => files.push(file),
            Some("") => {}
            Some(reason) => left_out.push(format!("{} ({reason})", file.display())),
        }
    }
    ensure!(!files.is_empty(), "{} has no scenario: put *.toml files into it", path.display());
    Ok(files)
}

/// Why a folder's entry does not run; empty where its name does not look like a scenario's.
fn reason_against(file: &Path) -> Option<&'static str> {
    let extension = file.extension().unwrap_or_default();
    let is_hidden = file.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    match fs::metadata(file) {
        _ if !extension.eq_ignore_ascii_case("toml") => Some(""),
        _ if extension != "toml" => Some("its name does not end with .toml"),
        _ if is_hidden => Some("hidden"),
        Err(_) => Some("it cannot be read, such as a link to nothing"),
        Ok(found) if !found.is_file() => Some("no file"),
        Ok(_) => None,
    }
}

fn named(files: Vec<PathBuf>) -> Vec<(String, PathBuf)> {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let mut times: BTreeMap<String, usize> = BTreeMap::new();
    for path in &files {
        *times.entry(stem(path)).or_default() += 1;
    }
    let name = |path: &Path| match stem(path) {
        stem if times[&stem] == 1 => stem,
        _ => path.with_extension("").display().to_string(),
    };
    files.into_iter().map(|path| (name(&path), path)).collect()
}

/// The cases of a file: one for each combination of its matrix, or one. A scenario that cannot be read is one, which
/// fails.
fn cases_of(name: &str, path: &Path) -> Vec<Case> {
    let scenario = masseter_plan::read_scenario(Some(path)).ok();
    let combinations =
        scenario.as_ref().and_then(|scenario| scenario.matrix.cases().ok()).unwrap_or_default();
    let case = |MatrixCase { name: values, assignments: set }: MatrixCase| {
        let name = if values.is_empty() { name.to_owned() } else { format!("{name}[{values}]") };
        let changed = scenario_with(Some(path), &set);
        let needs_processes = changed.is_ok_and(|scenario| needs_processes(&scenario));
        let tags = scenario.as_ref().map_or_else(Vec::new, |scenario: &Scenario| scenario.tags.clone());
        Case { name, path: path.to_owned(), set, tags, is_unread: scenario.is_none(), needs_processes }
    };
    match combinations.as_slice() {
        [] => vec![case(MatrixCase::default())],
        _ => combinations.into_iter().map(case).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_with_one_name_go_by_their_paths() {
        let names = |paths: &[&str]| {
            let named = named(paths.iter().map(PathBuf::from).collect());
            named.into_iter().map(|(name, _)| name).collect::<Vec<_>>()
        };
        assert_eq!(names(&["a/one.toml", "b/two.toml"]), ["one", "two"]);
        assert_eq!(names(&["a/one.toml", "b/one.toml", "b/two.toml"]), ["a/one", "b/one", "two"]);
    }

    /// Files of a folder by name and text, and a link to nothing.
    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [
            (
                "a.toml",
                "tags = ['slow']\n[matrix]\nmotion.kind = ['chewing', 'opening']\nrate_hz = [500, 1000]",
            ),
            ("b.TOML", ""),
            (".hidden.toml", ""),
            ("stall.toml", "[[faults]]\nkind = 'plant_stall'\nat_s = 0.1\nsize = '5 ms'"),
            ("wrong.toml", "rate_hzz = 1"),
            ("notes.txt", ""),
        ] {
            fs::write(folder.path().join(name), text).unwrap();
        }
        std::os::unix::fs::symlink("nothing", folder.path().join("gone.toml")).unwrap();
        folder
    }

    #[test]
    fn a_matrix_makes_cases_and_what_is_left_out_is_said() {
        let folder = folder();
        let found = Cases::find(&[folder.path().to_owned()], &Selection::default()).unwrap();
        let names: Vec<_> = found.chosen.iter().map(|case| case.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "a[kind=chewing,rate_hz=500]",
                "a[kind=chewing,rate_hz=1000]",
                "a[kind=opening,rate_hz=500]",
                "a[kind=opening,rate_hz=1000]",
                "stall",
                "wrong"
            ]
        );
        assert_eq!(found.chosen[1].set, ["motion.kind=\"chewing\"", "rate_hz=1000"]);
        assert!(found.chosen[4].needs_processes && !found.chosen[0].needs_processes);
        let name = |text: &String| text.rsplit('/').next().unwrap().to_owned();
        assert_eq!(
            found.left_out.iter().map(name).collect::<Vec<_>>(),
            [
                ".hidden.toml (hidden)",
                "b.TOML (its name does not end with .toml)",
                "gone.toml (it cannot be read, such as a link to nothing)"
            ]
        );
    }

    #[test]
    fn tags_words_and_shards_choose() {
        let folder = folder();
        let chosen = |selection| {
            let found = Cases::find(&[folder.path().to_owned()], &selection);
            found.map(|found| (found.chosen.len(), found.filtered_out)).map_err(|error| error.to_string())
        };
        let by_tag = || Selection { tags: vec!["slow".to_owned()], ..Selection::default() };
        assert_eq!(chosen(by_tag()), Ok((5, 1)), "a scenario that cannot be read may have the tag");
        let choice = Some("slow and not 500".parse().unwrap());
        assert_eq!(chosen(Selection { choice, ..by_tag() }), Ok((2, 4)));
        let shard = |number, of| Selection { shard: Some(Shard { number, of }), ..by_tag() };
        assert_eq!((chosen(shard(1, 3)), chosen(shard(3, 3))), (Ok((2, 4)), Ok((1, 5))));
        assert!(chosen(shard(1, 6)).unwrap_err().contains("5 scenarios have no 6 shares"));
        let of_words =
            |words: &str| Selection { choice: Some(words.parse().unwrap()), ..Selection::default() };
        assert!(chosen(of_words("fast")).unwrap_err().contains("there are: a[kind=chewing,rate_hz=500], "));
        let found = Cases::find(&[folder.path().to_owned()], &of_words("slow")).unwrap();
        let unread = |said: &String| said.ends_with("(it cannot be read: its tags are unknown)");
        assert!(found.left_out.iter().any(unread), "{:?}", found.left_out);
    }
}
